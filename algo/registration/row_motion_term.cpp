// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/row_motion_term.hpp"

#include <cmath>

#include "algo/base/robust_weights.hpp"

namespace plumb {

std::optional<RowMotionTerm::Rows> RowMotionTerm::Linearise(
    const Intrinsics& stated, const CalibrationModel& calibration,
    const bundle::CameraState& camera) const {
  const double dt_s = calibration.readout_s[0] * bundle::ReadoutFraction(pixel, stated);
  const bundle::SeenPoint seen = bundle::See(camera, p_world, dt_s);
  if (seen.p.z() < bundle::kNearestPoint_m) return std::nullopt;
  const bundle::SeenPixel projected = bundle::ProjectCorrected(stated, calibration.lens, seen.p);
  Rows rows;
  rows.r = (projected.pixel + shift_px - pixel) * weight;
  const double robust = std::sqrt(CauchyWeight(rows.r.squaredNorm(), loss_scale));
  rows.r *= robust;
  const Eigen::Matrix<double, 2, 3> J_point = robust * weight * projected.J_point;
  rows.J.leftCols<6>() = J_point * seen.J_pose;
  rows.J.middleCols<3>(6) = dt_s * J_point * Skew(camera.T_camera_world * p_world);
  rows.J.rightCols<3>() = -dt_s * J_point;
  return rows;
}

}  // namespace plumb
