// SPDX-License-Identifier: Apache-2.0
// The virtual sensor within this process, without a driver library.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "drivers/live/sensor_driver.hpp"
#include "drivers/live/sensor_events.hpp"
#include "drivers/simulator/player/virtual_bus.hpp"

namespace plumb {

/// Properties of the units of a bus.
struct VirtualUnits {
  std::shared_ptr<simulated::VirtualBus> bus;
  SensorSettings settings;
  /// Text of the calibration file, as recordings have it, by serial; other units get nominal
  /// intrinsics.
  std::map<std::string, std::string> calibrations;
  std::chrono::milliseconds stall_time{2000};  ///< Next() fails after this time without a pair.
};

/// Shows the units of a bus. At most one exists per bus at a time; its sensors may outlive it.
class VirtualProvider : public SensorProvider {
 public:
  explicit VirtualProvider(VirtualUnits units);
  ~VirtualProvider() override;
  VirtualProvider(const VirtualProvider&) = delete;
  VirtualProvider& operator=(const VirtualProvider&) = delete;

  [[nodiscard]] std::vector<SensorDescription> List() override;
  void SetListener(std::function<void()> changed) override;
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::string& serial) override;

 private:
  const VirtualUnits units_;
  const std::shared_ptr<SensorEvents> events_;
};

/// The driver "virtual".
void AddVirtualDriver(SensorRegistry& registry);

}  // namespace plumb
