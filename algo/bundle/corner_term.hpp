// SPDX-License-Identifier: Apache-2.0
// The residual of one observation of a marker's corner.
#pragma once

#include <Eigen/Core>

#include "algo/bundle/bundle_model.hpp"

namespace plumb::bundle {

/// Unknowns of the calibration that affect marker corners.
inline constexpr int kSeenByCorners = kEdgeBiasAt + 1;

/// The pose of a marker: T_world_marker0 * PoseFromTwist(twist).
struct MarkerState {
  const Pose& T_world_marker0;
  const Vector6d& twist;
};

/// With the corner X of a marker at M, the camera at the corner's row C, the projection pi through
/// the corrected lens, the observed pixel u and the edge bias e:
///
///     r = weight (pi(C M X) + e inward - u)        Cauchy loss of |r|, at kCornerLossScale
struct CornerTerm {
  int keyframe = 0;
  int marker = 0;  ///< Slot of the marker.
  Eigen::Vector3d in_marker;
  Eigen::Vector2d pixel;
  /// Sum of the unit directions along the two sides that meet at this corner, times the pixel
  /// scale.
  Eigen::Vector2d inward;
  double weight = 0;

  /// Weighted by the loss.
  struct Rows {
    Eigen::Vector2d r;
    Eigen::Matrix<double, 2, 6> J_marker;
    Eigen::Matrix<double, 2, kCamera> J_camera;
    Eigen::Matrix<double, 2, kSeenByCorners> J_calibration;
  };

  /// The corner must lie in front of the camera.
  [[nodiscard]] Rows Linearise(const Intrinsics& stated, const CalibrationModel& calibration,
                               const CameraState& camera, const MarkerState& state) const;
  /// 1/2 of the loss; infinite for a corner behind the camera.
  [[nodiscard]] double Cost(const Intrinsics& stated, const CalibrationModel& calibration,
                            const CameraState& camera, const MarkerState& state) const;
  [[nodiscard]] Eigen::Vector3d InWorld(const MarkerState& state) const;

 private:
  [[nodiscard]] Eigen::Vector2d Residual(const CalibrationModel& calibration,
                                         const SeenPixel& seen) const;
};

}  // namespace plumb::bundle
