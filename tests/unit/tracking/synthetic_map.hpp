// SPDX-License-Identifier: Apache-2.0
// Keyframes over a known landscape with a known sensor: everything is projected here, by no code of
// the method.
#pragma once

#include <vector>

#include "algo/map/map.hpp"
#include "algo/sensor_calibration/calibration_model.hpp"

namespace plumb::synthetic {

struct MapOptions {
  CalibrationModel
      sensor{};  ///< What the sensor really does; lens in addition to the stated intrinsics.
  int num_keyframes = 10;
  int num_landmarks = 250;
  bool markers = true;
  bool dense = false;  ///< Render depth images and their dense views too (lens without distortion).
  double pixel_noise = 0.0;  ///< Of keypoints and corners, pixels.
  double depth_noise_sigmas =
      0.0;  ///< Of the keypoints' depth, in standard deviations of the noise model.
  double image_noise_m = 0.0;  ///< Of the depth images, white.
  /// Keypoints get what the depth image shows at their pixels, and its slope: that is another place
  /// than their own where depth is shifted or comes later. Else their own depth, and no slope.
  bool read_depth_at_pixels = false;
};

struct TrueMap {
  Intrinsics stated;
  TrackingMap map;  ///< At the truth; observations as the sensor made them.
};

/// z of the landscape, metres: a plane with smooth hills and hollows.
[[nodiscard]] double Height(double x, double y);

/// Sweep of a moving camera about 0.9 m above the landscape; 320x240; the first keyframe is not the
/// origin.
[[nodiscard]] TrueMap MakeTrueMap(const MapOptions& options);

/// Moves all but the first keyframe, the landmarks and the markers away from where they are.
void Disturb(TrackingMap& map, double translation_m, double rotation_rad);

/// The map with all keypoint depths too large by that much; the pixels are unchanged.
[[nodiscard]] TrackingMap WithKeypointDepthsOff(TrackingMap map, double by_m);

/// Largest distance and angle between the keyframes of two maps.
struct MapError {
  double translation_m = 0.0;
  double rotation_rad = 0.0;
};
[[nodiscard]] MapError Compare(const TrackingMap& map, const TrackingMap& truth);

inline constexpr double kMarkerLength = 0.104;

}  // namespace plumb::synthetic
