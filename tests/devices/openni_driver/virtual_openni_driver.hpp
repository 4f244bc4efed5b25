// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// The driver "virtual-openni": the virtual sensor accessed through OpenNI2 like a real one.
void AddVirtualOpenNiDriver(SensorRegistry& registry);

}  // namespace plumb
