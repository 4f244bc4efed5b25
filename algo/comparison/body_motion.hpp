// Rigid motion of a body between two scans, from its surface.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>

#include "algo/base/pose.hpp"
#include "algo/comparison/region.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Both clouds in the reference frame (the current one after alignment); borrowed for the call.
struct BodyMotionInput {
  const PointCloud& reference_cloud;
  const Body& reference_body;
  const PointCloud& current_cloud;
  const Body& current_body;
  /// Accepts the points of the reference body that lie in the region of interest; none: all of the
  /// body.
  std::function<bool(const Eigen::Vector3d&)> in_region;
  Eigen::Vector3d region_centroid_m = Eigen::Vector3d::Zero();
  std::stop_token stop = {};  ///< Polled in each iteration; Interrupted follows.
};

/// What the surfaces alone say of the motion; the alignment's uncertainty is not in it.
struct SurfaceMotion {
  Pose T = Pose::Identity();               ///< p_current = T * p_reference
  Matrix6d covariance = Matrix6d::Zero();  ///< Left perturbation about T * region_centroid_m.
  double scale_m = 0.0;                    ///< Robust standard deviation of the residuals.
  double inlier_share = 0.0;               ///< Of the region's samples that have a weighted match.
  int iterations = 0;
};

/// Registers the reference body onto the current one.
///
/// Starts come from MotionStarts() (yaw and shift of the heights over the support), each is refined
/// on coarse samples and the best by a two-sided robust score goes on. Refinement: symmetric
/// point-to-plane distances (normal of both sides), matches in both directions, Tukey weights whose
/// scale follows the residuals, no matches on rims and none off the body. The covariance comes from
/// the scatter of the residuals' sums over 8 cm blocks, so errors that are alike over some
/// centimetres count as they should; information is measured with the two sides' normals crossed,
/// so noise of normals does not pretend to any (a cylinder shows no roll).
///
/// Nothing if either body has fewer than 50 samples or too few find a match. Deterministic,
/// thread-safe.
[[nodiscard]] std::optional<SurfaceMotion> EstimateBodyMotion(const BodyMotionInput& input);

}  // namespace plumb
