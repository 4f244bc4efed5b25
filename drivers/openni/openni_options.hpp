// SPDX-License-Identifier: Apache-2.0
// Options of sensors of the Xtion / Carmine class.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

struct OpenNiOptions : SensorSettings {
  /// libOpenNI2.so.0 to load; its drivers are those in `OpenNI2/Drivers` beside it. Empty: the
  /// system's.
  std::filesystem::path library = {};
  std::chrono::milliseconds stall_time{2000};  ///< Next() fails after this time without a pair.
  std::chrono::microseconds max_gap{
      16000};  ///< Between the stamps of a pair; less than half of the frame period.
  /// Called before the library is stopped, which waits for its drivers' threads under a lock that
  /// their callbacks need: everything that makes a driver call back must stop. Must not throw.
  std::function<void()> before_stop = {};
};

}  // namespace plumb
