// SPDX-License-Identifier: Apache-2.0
// The residuals of one observation of a keypoint: where it was seen, and how far it was.
#pragma once

#include <Eigen/Core>

#include "algo/bundle/bundle_model.hpp"

namespace plumb::bundle {

/// With the landmark X, the camera at the keypoint's row C, the same later, when the depth of that
/// row was read, C', the projection pi through the corrected lens, the observed pixel u and the
/// depth z that the image shows where it shows the keypoint:
///
///     r_px = weight_px (pi(C X) - u)               Cauchy loss of |r_px|, at kKeypointLossScale
///     r_z  = weight_z (depth(C' X) - z)            Cauchy loss of |r_z|, at the same scale
///
/// where depth() is PredictDepth(), because the residual must be one of the measurement.
struct KeypointTerm {
  int keyframe = 0;
  int landmark = 0;  ///< Slot of the landmark.
  Eigen::Vector2d pixel;
  DepthPlace place;
  DepthReading depth;  ///< Without depth there is no r_z.
  double weight_px = 0;
  double weight_z = 0;             ///< Per metre.
  double depth_after_color_s = 0;  ///< By the stamps.

  /// Weighted by the loss. Not initialised, because there are tens of thousands, of which parallel
  /// loops fill each.
  struct Rows {
    Eigen::Vector3d r;  ///< Pixel x, pixel y, depth.
    Eigen::Matrix3d J_point;
    Eigen::Matrix<double, 3, kCamera> J_camera;
    Eigen::Matrix<double, 2, kLensAndReadout> J_lens;  ///< Derivatives to lens and readout.
    DepthRow J_depth;

    /// J' M for this observation's derivatives J with respect to the whole calibration.
    template <int kColumns>
    [[nodiscard]] Eigen::Matrix<double, kCalibrationSize, kColumns> CalibrationTimes(
        const Eigen::Matrix<double, 3, kColumns>& M) const {
      Eigen::Matrix<double, kCalibrationSize, kColumns> product;
      product.template topRows<kLensAndReadout>().noalias() =
          J_lens.transpose() * M.template topRows<2>();
      product.row(kEdgeBiasAt).setZero();
      product.template bottomRows<CalibrationModel::kDepthSize>().noalias() =
          J_depth.transpose() * M.row(2);
      return product;
    }
  };

  /// The point must lie in front of the camera.
  [[nodiscard]] Rows Linearise(const Intrinsics& stated, const CalibrationModel& calibration,
                               const CameraState& camera, const Eigen::Vector3d& p_world) const;
  /// 1/2 of the losses; infinite for a point behind the camera.
  [[nodiscard]] double Cost(const Intrinsics& stated, const CalibrationModel& calibration,
                            const CameraState& camera, const Eigen::Vector3d& p_world) const;

 private:
  // Time from the colour image's stamp to the depth reading.
  [[nodiscard]] double DepthDelay(const CalibrationModel& calibration) const;
};

}  // namespace plumb::bundle
