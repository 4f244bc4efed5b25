#pragma once

#include "daemon/config/config.hpp"
#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// Converts the configuration to the settings that every sensor driver uses.
[[nodiscard]] inline SensorSettings SensorSettingsOf(const Config& config) {
  SensorSettings settings;
  settings.calibration_folder = config.appliance.calibration;
  settings.marker_dictionary = config.markers.dictionary.value_or(settings.marker_dictionary);
  settings.marker_length_m = config.markers.length_m.value_or(settings.marker_length_m);
  settings.reference_marker = config.markers.reference;
  return settings;
}

}  // namespace plumb
