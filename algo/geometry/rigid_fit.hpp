// SPDX-License-Identifier: Apache-2.0
// The rigid transform between two sets of paired points.
#pragma once

#include <span>

#include <Eigen/Core>

#include "algo/base/pose.hpp"

namespace plumb {

/// The result of FitRigid(). If `valid` is false, T_a_b is the identity: too few pairs, zero
/// weights, values that are not finite, or pairs on one line (rank < 2).
struct RigidFit {
  Pose T_a_b = Pose::Identity();  ///< p_a = T_a_b * p_b
  double rms_m = 0.0;             ///< Weighted root mean square of |p_a - T_a_b p_b|, metres.
  int rank = 0;  ///< Of the centred scatter: 0 a point, 1 a line, 2 a plane, 3 a volume.
  bool valid = false;
};

/// Least-squares rigid transform of paired points without scale (Horn 1987; Umeyama 1991 for the
/// sign of the determinant).
///
/// The rank is the smaller rank of the CENTRED scatters of both sets: four coplanar corners have
/// rank 2 and determine the transform; pairs on a line do not. A mirrored pairing gives the best
/// proper rotation, never a reflection, and a large rms_m.
///
/// @param weights  One per pair, >= 0, or empty for equal weights.
/// @throws std::invalid_argument if the numbers of points or weights differ, or a weight is
///         negative or not finite.
///
/// Thread-safe and deterministic.
[[nodiscard]] RigidFit FitRigid(std::span<const Eigen::Vector3d> points_a,
                                std::span<const Eigen::Vector3d> points_b,
                                std::span<const double> weights = {});

}  // namespace plumb
