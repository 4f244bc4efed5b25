// How well a body motion is known: one covariance for each of its causes, and their sum.
#pragma once

#include <array>
#include <utility>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/comparison/scene_alignment.hpp"

namespace plumb {

/// Covariances of a body motion by cause. Each: rotation vector (rad), translation (m), reference
/// frame, left perturbation about the moved centroid of the region. The causes are independent.
struct MotionUncertainty {
  Matrix6d surface = Matrix6d::Zero();     ///< Registration of the two surfaces onto each other.
  Matrix6d markers = Matrix6d::Zero();     ///< Fit of the two marker maps onto each other.
  Matrix6d distortion = Matrix6d::Zero();  ///< What a place between the markers may be off by.
  Matrix6d scale = Matrix6d::Zero();       ///< Length of the maps over the way that the body moved.
  Matrix6d frame = Matrix6d::Zero();       ///< Pose of the reference marker in its own map.
  Matrix6d sweep = Matrix6d::Zero();       ///< What neither markers nor surfaces of a sweep show.

  [[nodiscard]] Matrix6d Total() const {
    return surface + markers + distortion + scale + frame + sweep;
  }
  /// The causes with their names, in a fixed order.
  [[nodiscard]] std::array<std::pair<const char*, const Matrix6d*>, 6> Parts() const;
};

/// What Uncertainty() joins. Borrowed for the call.
struct UncertaintyInput {
  const Alignment& alignment;
  const Matrix6d& surface;           ///< SurfaceMotion::covariance, about the moved centroid.
  Pose T_motion = Pose::Identity();  ///< p_current = T_motion * p_reference
  Eigen::Vector3d centroid_m = Eigen::Vector3d::Zero();  ///< Of the region, reference frame.
};

[[nodiscard]] MotionUncertainty Uncertainty(const UncertaintyInput& input);

/// A covariance (left perturbation) about another point.
[[nodiscard]] Matrix6d CovarianceAbout(const Matrix6d& covariance, const Eigen::Vector3d& from_m,
                                       const Eigen::Vector3d& to_m);

}  // namespace plumb
