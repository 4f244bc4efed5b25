// The program plumbd: options, set-up in the right order, the loop, and the way down.
#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// @param registry  The drivers of sensors that the configuration may name.
/// Exit codes as those of plumb: 0 ended by a signal, 1 internal or I/O error, 2 usage, 3 bad
/// configuration.
int RunPlumbd(int argc, char** argv, const SensorRegistry& registry = BuiltInSensors());

}  // namespace plumb
