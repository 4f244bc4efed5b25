// SPDX-License-Identifier: Apache-2.0
// A small virtual sensor for tests: rendered once into the build tree, then reused.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "drivers/openni/openni_provider.hpp"
#include "tests/devices/openni_driver/virtual_sensor.hpp"

namespace plumb::testing {

/// Two scenes of 20 frames at 320 x 240.
[[nodiscard]] inline VirtualSensorOptions SmallVirtualSensor() {
  VirtualSensorOptions options;
  options.frames = 20;
  options.width = 320;
  options.height = 240;
  options.cache_folder = PLUMB_VIRTUAL_CACHE;
  return options;
}

/// The virtual sensor with a function for each command.
struct CommandedSensor : VirtualSensor {
  using VirtualSensor::VirtualSensor;
  void Plug() const { (void)Command("plug"); }
  void Unplug() const { (void)Command("unplug"); }
  void Stall() const { (void)Command("stall"); }    ///< No frames arrive, and nothing is reported.
  void Resume() const { (void)Command("resume"); }  ///< Ends a stall and an error.
  void Error() const { (void)Command("error"); }  ///< The driver reports a failure and frames stop.
  void NextScene() const { (void)Command("next-scene"); }
  void Rewind() const { (void)Command("rewind"); }
};

/// The sensor together with the provider that sees it.
struct VirtualRig {
  explicit VirtualRig(const VirtualSensorOptions& sensor_options = SmallVirtualSensor(),
                      std::chrono::milliseconds stall_time = std::chrono::milliseconds(2000))
      : sensor(sensor_options), provider(Options(stall_time)) {}

  [[nodiscard]] OpenNiOptions Options(std::chrono::milliseconds stall_time) const {
    OpenNiOptions options;
    options.library = sensor.runtime_library();
    options.calibration_folder = sensor.calibration_folder();
    options.markers_are_the_rooms = false;
    options.stall_time = stall_time;
    return options;
  }

  CommandedSensor sensor;
  OpenNiProvider provider;
};

/// Waits for a condition that another thread makes true; false after a generous time.
[[nodiscard]] inline bool Eventually(const std::function<bool()>& condition) {
  const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > limit) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

}  // namespace plumb::testing
