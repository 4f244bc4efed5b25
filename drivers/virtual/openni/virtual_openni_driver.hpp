#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// The driver "virtual-openni": the virtual sensor accessed through OpenNI2 like a real one. Also
/// provides the recording format .oni; simulated frames are written to such files through that
/// sensor.
void AddVirtualOpenNiDriver(SensorRegistry& registry);

}  // namespace plumb
