// SPDX-License-Identifier: Apache-2.0
// The residual of a point seen by a rolling shutter: the row in which it appears gives the time at
// which it was read, and so constrains the velocity of the camera.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "algo/bundle/bundle_model.hpp"

namespace plumb {

/// With the point X, the camera C moving with the velocity v, the time t at which the point's row
/// was read, the projection pi through the corrected lens and the observed pixel u:
///
///     r = weight (pi(C(t, v) X) + shift - u)       Cauchy loss of |r|, at loss_scale
///
/// in the twist of the camera and the change of v (turning, then shifting).
struct RowMotionTerm {
  Eigen::Vector3d p_world;
  Eigen::Vector2d pixel;
  Eigen::Vector2d shift_px;
  double weight = 0;
  double loss_scale = 0;  ///< In standard deviations.

  /// Weighted by the loss.
  struct Rows {
    Eigen::Vector2d r;
    Eigen::Matrix<double, 2, 12> J;
  };
  /// Nothing for a point behind the camera.
  [[nodiscard]] std::optional<Rows> Linearise(const Intrinsics& stated,
                                              const CalibrationModel& calibration,
                                              const bundle::CameraState& camera) const;
};

}  // namespace plumb
