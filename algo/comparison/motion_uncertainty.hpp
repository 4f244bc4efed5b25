// Uncertainty of a body motion: one covariance for each cause, and their sum.
#pragma once

#include <array>
#include <optional>
#include <utility>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/comparison/scene_alignment.hpp"

namespace plumb {

/// Covariances of a body motion by cause. Each holds the rotation vector (rad), then the
/// translation (m), in the reference frame, as a left perturbation about the moved centroid of the
/// region. The causes are independent.
struct MotionUncertainty {
  Matrix6d surface = Matrix6d::Zero();  ///< Registration of the two surfaces to each other.
  Matrix6d markers = Matrix6d::Zero();  ///< Fit of the two marker maps to each other.
  /// Distortion of the marker maps at a place between the markers.
  Matrix6d distortion = Matrix6d::Zero();
  /// Scale error of the maps over the distance that the body moved.
  Matrix6d scale = Matrix6d::Zero();
  Matrix6d frame = Matrix6d::Zero();  ///< Pose of the reference marker in its own map.
  /// Calibrations of the two sensors: see SharedSensor.
  Matrix6d sensor = Matrix6d::Zero();
  Matrix6d breathing = Matrix6d::Zero();  ///< Breathing during the two sweeps.

  [[nodiscard]] Matrix6d Total() const {
    return surface + markers + distortion + scale + frame + sensor + breathing;
  }
  /// The causes with their names, in a fixed order.
  [[nodiscard]] std::array<std::pair<const char*, const Matrix6d*>, 7> Parts() const;
};

/// Input of Uncertainty(). Borrowed for the call.
struct UncertaintyInput {
  const Alignment& alignment;
  const Matrix6d& surface;           ///< SurfaceMotion::covariance, about the moved centroid.
  Pose T_motion = Pose::Identity();  ///< p_current = T_motion * p_reference
  /// Centroid of the region in the reference frame.
  Eigen::Vector3d centroid_m = Eigen::Vector3d::Zero();
  /// SharedSensor::covariance; absent where a scene has no sensitivity.
  std::optional<Matrix6d> sensor;
  double breathing_m = 0.0;  ///< Rise of chest and belly, root of the squares of both sweeps.
};

[[nodiscard]] MotionUncertainty Uncertainty(const UncertaintyInput& input);

/// Moves a covariance (left perturbation) to another reference point.
[[nodiscard]] Matrix6d CovarianceAbout(const Matrix6d& covariance, const Eigen::Vector3d& from_m,
                                       const Eigen::Vector3d& to_m);

}  // namespace plumb
