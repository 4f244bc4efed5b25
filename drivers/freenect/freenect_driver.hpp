// SPDX-License-Identifier: Apache-2.0
// The driver "freenect": Kinects of the first kind, through libfreenect.
#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

void AddFreenectDriver(SensorRegistry& registry);

}  // namespace plumb
