// SPDX-License-Identifier: Apache-2.0
// Estimates the rigid motion of a body between two scans from its surface.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <vector>

#include "algo/base/pose.hpp"
#include "algo/motion/region.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Both clouds in the reference frame (the current one after alignment); borrowed for the call.
struct BodyMotionInput {
  const PointCloud& reference_cloud;
  const Body& reference_body;
  const PointCloud& current_cloud;
  const Body& current_body;
  /// Accepts the points of the reference body that lie in the region of interest. If not set, the
  /// whole body is used.
  std::function<bool(const Eigen::Vector3d&)> in_region;
  Eigen::Vector3d region_centroid_m = Eigen::Vector3d::Zero();
  /// Starting poses besides those that are searched: where a room or a plan says where a body is.
  std::vector<Pose> starts = {};
  std::stop_token stop = {};  ///< Polled in each iteration; a stop request throws Interrupted.
};

/// The motion as the surfaces determine it, without the alignment's uncertainty.
struct SurfaceMotion {
  Pose T = Pose::Identity();               ///< p_current = T * p_reference
  Matrix6d covariance = Matrix6d::Zero();  ///< Left perturbation about T * region_centroid_m.
  double scale_m = 0.0;                    ///< Robust standard deviation of the residuals.
  /// Fraction of the region's samples that have a weighted correspondence.
  double inlier_fraction = 0.0;
  int iterations = 0;
};

/// Registers the reference body onto the current one.
///
/// Starting poses come from MotionStarts() (yaw and shift of the heights above the support). Each
/// is refined on coarse samples, and the one with the best robust two-sided score is refined
/// further. Refinement uses symmetric point-to-plane distances (normals of both sides),
/// correspondences in both directions, and Tukey weights whose scale follows the residuals. Rims
/// and points off the body take no part.
///
/// The covariance comes from the scatter of the residuals summed over 8 cm blocks, so that errors
/// which are correlated over some centimetres are counted correctly. The information matrix uses
/// one normal from each side, so that noise of the normals does not appear as information (a
/// cylinder does not determine its roll).
///
/// Returns nothing if either body has fewer than 50 samples or too few find a correspondence.
/// Deterministic and thread-safe.
[[nodiscard]] std::optional<SurfaceMotion> EstimateBodyMotion(const BodyMotionInput& input);

}  // namespace plumb
