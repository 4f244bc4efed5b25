// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// The recording format .oni: read, recorded from sensors of OpenNI2, written from any source of
/// frames.
void AddOniRecordings(SensorRegistry& registry);

}  // namespace plumb
