// SPDX-License-Identifier: Apache-2.0
// What the apps of LiDAR phones state of a recording, from the texts that they export.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "algo/sensor_model/depth_sensor.hpp"

namespace plumb {

struct PhoneMetadata {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< Of the colour images; the apps rectify them.
  int width = 0, height = 0;              ///< 0: not stated.
  std::vector<double> stamps_s = {};      ///< Of the images by their numbers; they rise strictly.
                                          ///< NaN: the app has no such image.
  std::optional<double> rate_hz = {};     ///< For images without stamps.
  /// By how much the focal length changes over the recording, as a share of it: autofocus. The
  /// camera above is then the median of the images'.
  double focal_spread = 0.0;
  DepthSensor sensor = DepthSensor::kLidar;
};

/// Record3D's metadata.json. @param name  Of the file, for messages.
/// @return nothing if the text is not of Record3D. @throws DataError if it cannot be used.
[[nodiscard]] std::optional<PhoneMetadata> ParseRecord3d(std::string_view text,
                                                         const std::string& name);

/// Stray Scanner's camera_matrix.csv (3 x 3) and odometry.csv (time, number, pose).
/// @throws DataError
[[nodiscard]] PhoneMetadata ParseStray(std::string_view matrix, std::string_view odometry);

}  // namespace plumb
