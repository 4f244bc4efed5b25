// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "daemon/config/config.hpp"
#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// Converts the configuration to the settings that every sensor driver uses.
[[nodiscard]] inline SensorSettings SensorSettingsOf(const Config& config) {
  SensorSettings settings;
  settings.calibration_folder = config.appliance.calibration;
  settings.stream_socket = config.appliance.sensor_socket;
  settings.library = config.appliance.sensor_library;
  settings.exposure_us = config.appliance.sensor_exposure_us;
  settings.room_markers = config.markers.Or(settings.room_markers);
  return settings;
}

}  // namespace plumb
