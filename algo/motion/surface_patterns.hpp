// SPDX-License-Identifier: Apache-2.0
// What a registration would take for a motion where a surface lies elsewhere than it is known to.
#pragma once

#include <functional>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Motions (rotation vector, translation about the moved centroid) per metre of each pattern: a
/// surface that is farther out along its normals, or higher, everywhere; or tilted like the plane
/// that fits such a step over one half of the region best, along the y axis or across it.
struct PatternMotions {
  Vector6d out, out_along, out_across, up, up_along;
};

/// @param cloud  With normals, z up.
/// @param T_motion  p_current = T_motion * p_reference; `moved_m` is the moved centroid.
[[nodiscard]] PatternMotions MotionsOfPatterns(
    const PointCloud& cloud, const std::function<bool(const Eigen::Vector3d&)>& in_region,
    const Pose& T_motion, const Eigen::Vector3d& moved_m);

}  // namespace plumb
