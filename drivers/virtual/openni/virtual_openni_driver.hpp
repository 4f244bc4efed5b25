#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// The driver "virtual-openni": the virtual sensor seen through OpenNI2, as real ones are. Also the
/// recording format .oni, whose files from simulated frames are written through that sensor.
void AddVirtualOpenNiDriver(SensorRegistry& registry);

}  // namespace plumb
