// SPDX-License-Identifier: Apache-2.0
// The driver "orbbec": cameras of Orbbec, through OrbbecSDK 2.
#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

void AddOrbbecDriver(SensorRegistry& registry);

}  // namespace plumb
