// SPDX-License-Identifier: Apache-2.0
// The driver "realsense": cameras of RealSense, through librealsense2.
#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

void AddRealSenseDriver(SensorRegistry& registry);

}  // namespace plumb
