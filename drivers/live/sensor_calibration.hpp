// SPDX-License-Identifier: Apache-2.0
// Finds the calibration of a live sensor's camera before its first frame.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "algo/sensor_model/depth_sensor.hpp"
#include "algo/types/frame.hpp"
#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// What a driver knows of its units' depth camera. A unit's file may state its own: the key
/// depth_sensor, if it names another class, brings that class's noise and range along.
struct KnownDepth {
  DepthSensor sensor = DepthSensor::kStructuredLight;
  DepthNoise noise = {};
  UsableDepth range = {};
};
[[nodiscard]] KnownDepth KnownOfClass(DepthSensor sensor);

/// `FOLDER/SERIAL.yaml`. Characters that do not belong in a file name are replaced by `_`, because
/// the serial comes from the device.
[[nodiscard]] std::filesystem::path CalibrationFile(const std::filesystem::path& folder,
                                                    const std::string& serial);

/// The unit's calibration file, scaled to the image size, or nominal intrinsics with a warning.
/// @param horizontal_fov_rad  Of the colour camera as stated by the driver; outside (0.2, 2.5):
///         TUM's published 525 pixels.
/// @throws DeviceError if the unit's file exists but is damaged, is for images of another shape, or
///         names other markers than the room's (SensorSettings::markers_are_the_rooms).
[[nodiscard]] StreamInfo LiveStreamInfo(const SensorSettings& settings, const std::string& serial,
                                        int width, int height, double horizontal_fov_rad,
                                        const KnownDepth& known = {});

/// As LiveStreamInfo() for a unit whose calibration file has this text.
/// @param name  Name of the file for messages.
[[nodiscard]] StreamInfo CalibratedStreamInfo(const SensorSettings& settings,
                                              const std::string& text, const std::string& name,
                                              const std::string& serial, int width, int height,
                                              const KnownDepth& known = {});

/// The unit's calibration file, for images of the size that it states; nothing if there is none.
/// @throws DeviceError as LiveStreamInfo(), but for the shape of the images.
[[nodiscard]] std::optional<StreamInfo> StatedCalibration(const SensorSettings& settings,
                                                          const std::string& serial);

}  // namespace plumb
