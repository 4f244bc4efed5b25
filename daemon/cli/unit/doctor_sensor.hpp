// SPDX-License-Identifier: Apache-2.0
// What `plumb doctor` says of the sensor: driver, attached units and their calibrations.
#pragma once

#include <string>

#include "daemon/cli/unit/doctor_report.hpp"
#include "daemon/config/config.hpp"
#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// @param wanted  Serial that the configuration states; empty: any.
/// @throws DeviceError if the driver cannot be used.
void CheckAttached(DoctorReport& report, const SensorDriver& driver, const SensorSettings& settings,
                   const std::string& wanted);

/// All of it, by the configured driver.
void CheckSensor(DoctorReport& report, const Config& config);

}  // namespace plumb
