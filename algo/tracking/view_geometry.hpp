// SPDX-License-Identifier: Apache-2.0
// What the tracker asks of views in several places: how far apart two of them are, and which points
// are in front of a camera.
#pragma once

#include <algorithm>

#include "algo/base/pose.hpp"
#include "algo/map/map.hpp"

namespace plumb {

/// Points nearer than this to a camera, or behind it, are not projected into it. No sensor of this
/// class measures below 0.3 m.
inline constexpr double kNearestInView_m = 0.1;

/// A view's depth as the scale of its distances, kept within the range of such sensors: a few wrong
/// depths must not make every other view far or near.
[[nodiscard]] inline double ScaleOfView(const MapKeyframe& keyframe) {
  constexpr double kLeast_m = 0.4;
  constexpr double kMost_m = 3.0;
  return std::clamp(keyframe.median_depth_m, kLeast_m, kMost_m);
}

/// Dissimilarity of two views: the distance of the cameras as a fraction of the depth, plus
/// radians.
[[nodiscard]] inline double ViewDistance(const MapKeyframe& from, const Pose& T_world_other) {
  const Pose T = from.T_world_color.inverse() * T_world_other;
  return T.translation().norm() / ScaleOfView(from) + RotationAngle(T);
}

/// The largest distance of two views that may show the same surfaces: 40 degrees, or seven tenths
/// of the depth sideways.
inline constexpr double kViewReach = 0.7;

}  // namespace plumb
