// SPDX-License-Identifier: Apache-2.0
// Answers the requests of the control socket.
#pragma once

#include <functional>
#include <string>

#include "daemon/appliance/appliance.hpp"
#include "daemon/control/control_server.hpp"
#include "daemon/loop/work_thread.hpp"
#include "daemon/services/updates.hpp"
#include "web/service/upkeep_services.hpp"

namespace plumb {

/// Used on the loop's thread.
class ControlDesk {
 public:
  /// The first six are borrowed.
  /// @param presence_code  The code that proves that one sees the console.
  /// @param simulate  Executes `sim ACTION ARGUMENT` on a separate thread; throws DeviceError.
  ControlDesk(EventLoop& loop, Appliance& appliance, StorageUpkeep& upkeep,
              LiveMonitoring& monitoring, Updates& updates, web::MaintenanceService& maintenance,
              std::function<void(const std::string& command)> simulate,
              std::function<std::string()> presence_code);

  void Answer(const ControlRequest& request, const ControlServer::Reply& reply);

 private:
  void Simulate(const ControlRequest& request, const ControlServer::Reply& reply);

  EventLoop& loop_;
  Appliance& appliance_;
  StorageUpkeep& upkeep_;
  LiveMonitoring& monitoring_;
  Updates& updates_;
  web::MaintenanceService& maintenance_;
  std::function<void(const std::string&)> simulate_;
  std::function<std::string()> presence_code_;
  WorkThread device_thread_{16};
};

}  // namespace plumb
