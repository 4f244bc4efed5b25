#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// The driver "openni": sensors of the Xtion class.
void AddOpenNiDriver(SensorRegistry& registry);

}  // namespace plumb
