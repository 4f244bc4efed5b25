// SPDX-License-Identifier: Apache-2.0
// A sum of residuals that enters a bundle adjustment as its quadratic form.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "algo/sensor_calibration/calibration_model.hpp"

namespace plumb {

/// A quadratic form in the twists of two keyframes (or of one keyframe and a marker), the focal
/// lengths and the depth calibration: 1/2 x' H x + g' x. Here x holds the twists from the poses at
/// the time of linearisation (on the camera's or the marker's side) and the changes of the first
/// kFocal entries of CalibrationModel::lens and of CalibrationModel::depth. Sums of millions of
/// point-to-plane residuals are passed in this form.
struct QuadraticTerm {
  // Of the unknowns: the twist of keyframe a and that of keyframe b or the marker, rotations first;
  // focal lengths; the calibration's depth terms.
  static constexpr int kTwistA = 0;
  static constexpr int kTwistB = 6;
  static constexpr int kFocal = 2;
  static constexpr int kFocalAt = 12;
  static constexpr int kDepthCalibrationAt = kFocalAt + kFocal;
  static constexpr int kSize = kDepthCalibrationAt + CalibrationModel::kDepthSize;
  int keyframe_a = 0;
  /// Exactly one of these two is set.
  std::optional<int> keyframe_b;
  std::optional<int> marker;  ///< Id of the marker.
  Eigen::Matrix<double, kSize, kSize> H = Eigen::Matrix<double, kSize, kSize>::Zero();
  Eigen::Matrix<double, kSize, 1> g = Eigen::Matrix<double, kSize, 1>::Zero();

  using Vector = Eigen::Matrix<double, kSize, 1>;
  /// Up to a constant: the cost at the linearisation is zero.
  [[nodiscard]] double Cost(const Vector& x) const { return x.dot(0.5 * (H * x) + g); }
  /// Derivative of the cost.
  [[nodiscard]] Vector Slope(const Vector& x) const { return H * x + g; }
};

}  // namespace plumb
