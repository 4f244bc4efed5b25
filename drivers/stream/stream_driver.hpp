// SPDX-License-Identifier: Apache-2.0
// The driver "stream": frames from any program, at a Unix socket.
#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

void AddStreamDriver(SensorRegistry& registry);

}  // namespace plumb
