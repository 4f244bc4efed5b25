// SPDX-License-Identifier: Apache-2.0
// The program plumbd: options, ordered set-up, the loop, and shutdown.
#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// @param registry  The sensor drivers that the configuration may name.
/// Exit codes as for plumb: 0 ended by a signal, 1 internal or I/O error, 2 usage, 3 bad
/// configuration.
int RunPlumbd(int argc, char** argv, const SensorRegistry& registry = BuiltInSensors());

}  // namespace plumb
