// SPDX-License-Identifier: Apache-2.0
// Passes reports of a driver's threads about its units to the open sensors and to the listener.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "drivers/live/frame_box.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

/// Shared by a provider, its sensors and the driver's threads. Thread-safe.
class SensorEvents {
 public:
  /// Once another listener, or none, was set, the previous one is not called any more.
  void SetListener(std::function<void()> changed);
  /// Reports that something was plugged in, unplugged or changed.
  void Notify();

  /// From now on the box is notified about its unit, until it is destroyed.
  void Watch(const std::string& uri, const std::shared_ptr<FrameBox>& box);
  void Lose(const std::string& uri);                    ///< The unit was unplugged for good.
  void SetFailed(const std::string& uri, bool failed);  ///< An error of the unit begins or ends.

 private:
  void ForBoxes(const std::string& uri, const std::function<void(FrameBox&)>& change);

  std::mutex listener_mutex_;
  std::function<void()> listener_;
  std::mutex mutex_;
  std::vector<std::pair<std::string, std::weak_ptr<FrameBox>>> boxes_;  ///< Boxes of open sensors.
};

/// The sensor with that serial, or the first one for an empty serial.
/// @throws DeviceError naming what is attached instead.
[[nodiscard]] const SensorDescription& ChooseSensor(const std::vector<SensorDescription>& sensors,
                                                    const std::string& serial);

}  // namespace plumb
