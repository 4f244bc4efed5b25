// Answers the requests of the control socket.
#pragma once

#include <functional>
#include <string>

#include "daemon/appliance/appliance.hpp"
#include "daemon/appliance/updates.hpp"
#include "daemon/control/control_server.hpp"
#include "daemon/loop/work_thread.hpp"

namespace plumb {

/// Used on the loop's thread.
class ControlDesk {
 public:
  /// @param simulate  Executes `sim ACTION ARGUMENT` on a separate thread; throws DeviceError.
  ControlDesk(Appliance& appliance, Updates& updates,
              std::function<void(const std::string& command)> simulate);

  void Answer(const ControlRequest& request, const ControlServer::Reply& reply);

 private:
  void Simulate(const ControlRequest& request, const ControlServer::Reply& reply);

  Appliance& appliance_;
  Updates& updates_;
  std::function<void(const std::string&)> simulate_;
  WorkThread device_thread_{16};
};

}  // namespace plumb
