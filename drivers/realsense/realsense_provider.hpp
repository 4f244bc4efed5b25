// SPDX-License-Identifier: Apache-2.0
// The cameras that librealsense2 finds.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drivers/live/sensor_driver.hpp"
#include "drivers/realsense/realsense_unit.hpp"

namespace plumb::realsense {

class RealSenseProvider : public SensorProvider {
 public:
  /// @throws DeviceError if the library cannot be used.
  explicit RealSenseProvider(const SensorSettings& settings);
  ~RealSenseProvider() override;

  [[nodiscard]] std::vector<SensorDescription> List() override;
  void SetListener(std::function<void()> changed) override;
  /// @throws DeviceError also for a camera at a USB 2 port or with too old firmware
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::string& serial) override;

  /// What is attached, for people; and the library.
  [[nodiscard]] std::vector<RealSenseUnit> Units();
  [[nodiscard]] const RealSenseLibrary& library() const;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace plumb::realsense
