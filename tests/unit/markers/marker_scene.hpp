// SPDX-License-Identifier: Apache-2.0
// Images of markers with exact truth: area-true sampling in linear light, then blur, the sRGB tone
// curve, noise and 8 bits.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/marker_dictionary.hpp"

namespace plumb::testing {

struct PlacedMarker {
  int id = 0;
  Pose T_camera_marker =
      Pose::Identity();  ///< Marker frame: x right, y up on the print, z out of it.
};

struct SceneLook {
  double length_m = 0.104;
  double quiet_zone_cells = 1.0;  ///< White paper around the black square.
  double blur_px = 0.7;           ///< Sigma of a Gaussian.
  double motion_px = 0.0;         ///< Length of a straight motion blur ...
  double motion_angle_rad = 0.0;  ///< ... and its direction.
  double noise = 1.5;             ///< Sigma in grey levels, after the tone curve.
  double white = 0.75, black = 0.04, ground = 0.25;  ///< Linear light, 1 is full scale.
  double shading = 0.2;  ///< Share of light lost from the left to the right image border.
};

/// Renders markers in front of the camera (nearer ones must not overlap others) into a CV_8UC1
/// image.
cv::Mat Render(const MarkerDictionary& dictionary, const std::vector<PlacedMarker>& markers,
               const Intrinsics& intrinsics, const SceneLook& look, std::mt19937& random);

/// Where the corners of a marker truly are.
ImageCorners TrueCorners(const PlacedMarker& marker, double length_m, const Intrinsics& intrinsics);

/// A marker that faces the camera within `max_tilt_rad`, turned at random, whose side measures
/// about `side_px`, wholly in view.
PlacedMarker RandomMarker(int id, double side_px, double max_tilt_rad, double length_m,
                          const Intrinsics& intrinsics, std::mt19937& random);

}  // namespace plumb::testing
