// SPDX-License-Identifier: Apache-2.0
// Classes of depth cameras, and what is known of each before a unit was seen.
#pragma once

#include "algo/base/names.hpp"
#include "algo/sensor_model/depth_noise.hpp"

namespace plumb {

enum class DepthSensor { kStructuredLight, kActiveStereo, kTimeOfFlight, kLidar };
template <>
inline constexpr auto kNamesOf<DepthSensor> = NamesUpTo<DepthSensor::kLidar>(
    {"structured_light", "active_stereo", "time_of_flight", "lidar"});

/// Range of depth that is used, metres: outside of it a sensor of the class gives numbers that mean
/// little.
struct UsableDepth {
  double nearest_m = 0.3;
  double farthest_m = 4.0;

  bool operator==(const UsableDepth&) const = default;
};

/// Standard deviations of a class's calibration where they differ from structured light's, which
/// are CalibrationModel's own. 0: the class does not have the term.
struct ClassSigmas {
  /// Of the depth's disparity (a constant shift between the two images that are matched), as the
  /// relative error of depth for each metre of it: shift / (focal length in px * baseline).
  double disparity_per_m = 0.0;
  /// Its change over half an image width.
  double disparity_tilt_per_m = 0.0;
  double scale = 0.01;
  double offset_m = 0.003;
  double bow_m = 0.004;
  double shift_px = 2.0;    ///< Of the depth image against colour, at 640 columns.
  double delay_s = 0.004;   ///< By which depth was taken later than stamped, relative to colour.
  double slope = 0.003;     ///< Per half image width.
  double field = 1.0;       ///< Factor of the distortion field's.
  double growth = 1.0;      ///< Factor of its growth with distance.
  double readout_s = 0.02;  ///< Of the depth image.
};

struct DepthSensorClass {
  DepthNoise noise = {};
  UsableDepth range = {};
  /// Lag in pixels (at 640 columns) at which neighbours' errors are hardly correlated any more.
  double correlation_px = 9.0;
  /// Pixels (at 640 columns) beside a depth edge that carry the other surface's depth.
  int edge_px = 0;
  ClassSigmas sigmas = {};
};

[[nodiscard]] const DepthSensorClass& ClassOf(DepthSensor sensor);

}  // namespace plumb
