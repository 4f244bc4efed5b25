// SPDX-License-Identifier: Apache-2.0
#include "drivers/live/sensor_events.hpp"

#include <algorithm>

#include "algo/base/errors.hpp"
#include "words/sensor.hpp"

namespace plumb {

void SensorEvents::SetListener(std::function<void()> changed) {
  const std::lock_guard lock(listener_mutex_);
  listener_ = std::move(changed);
}

void SensorEvents::Notify() {
  const std::lock_guard lock(listener_mutex_);
  if (listener_) listener_();
}

void SensorEvents::Watch(const std::string& uri, const std::shared_ptr<FrameBox>& box) {
  const std::lock_guard lock(mutex_);
  std::erase_if(boxes_, [](const auto& entry) { return entry.second.expired(); });
  boxes_.emplace_back(uri, box);
}

void SensorEvents::ForBoxes(const std::string& uri, const std::function<void(FrameBox&)>& change) {
  const std::lock_guard lock(mutex_);
  for (const auto& [box_uri, weak] : boxes_) {
    if (const auto box = weak.lock(); box && box_uri == uri) change(*box);
  }
}

void SensorEvents::Lose(const std::string& uri) {
  ForBoxes(uri, [](FrameBox& box) { box.Lose(); });
}

void SensorEvents::SetFailed(const std::string& uri, bool failed) {
  ForBoxes(uri, [failed](FrameBox& box) { box.SetFailed(failed); });
}

const SensorDescription& ChooseSensor(const std::vector<SensorDescription>& sensors,
                                      const std::string& serial) {
  const auto found = std::find_if(sensors.begin(), sensors.end(), [&](const auto& sensor) {
    return serial.empty() || sensor.serial == serial;
  });
  if (found != sensors.end()) return *found;
  if (serial.empty()) throw DeviceError(say::sensor::NoneAttached());
  throw DeviceError(sensors.empty() ? say::sensor::NotAttached(serial)
                                    : say::sensor::OtherAttached(serial, sensors.front().serial));
}

}  // namespace plumb
