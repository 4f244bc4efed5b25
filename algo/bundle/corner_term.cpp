// SPDX-License-Identifier: Apache-2.0
#include "algo/bundle/corner_term.hpp"

#include <cmath>
#include <limits>

#include "algo/base/robust_weights.hpp"

namespace plumb::bundle {

Eigen::Vector3d CornerTerm::InWorld(const MarkerState& state) const {
  return state.T_world_marker0 * (PoseFromTwist(state.twist) * in_marker);
}

Eigen::Vector2d CornerTerm::Residual(const CalibrationModel& calibration,
                                     const SeenPixel& seen) const {
  return (seen.pixel + calibration.edge_bias_px[0] * inward - pixel) * weight;
}

CornerTerm::Rows CornerTerm::Linearise(const Intrinsics& stated,
                                       const CalibrationModel& calibration,
                                       const CameraState& camera, const MarkerState& state) const {
  const double fraction = ReadoutFraction(pixel, stated);
  const SeenPoint point = See(camera, InWorld(state), calibration.readout_s[0] * fraction);
  const SeenPixel seen = ProjectCorrected(stated, calibration.lens, point.p);
  Rows rows;
  rows.r = Residual(calibration, seen);
  const double robust = std::sqrt(CauchyWeight(rows.r.squaredNorm(), kCornerLossScale));
  const double w = robust * weight;
  rows.r *= robust;
  const Eigen::Matrix<double, 2, 3> J = w * seen.J_point;
  Matrix3x6d J_in_world;
  J_in_world.leftCols<3>() = -(state.T_world_marker0 * PoseFromTwist(state.twist)).linear() *
                             Skew(in_marker) * RightJacobian(state.twist.head<3>());
  J_in_world.rightCols<3>() = state.T_world_marker0.linear();
  rows.J_marker = J * point.J_world * J_in_world;
  rows.J_camera = J * point.J_pose;
  rows.J_calibration << w * seen.J_lens, fraction * (J * point.J_time), w * inward;
  return rows;
}

double CornerTerm::Cost(const Intrinsics& stated, const CalibrationModel& calibration,
                        const CameraState& camera, const MarkerState& state) const {
  const double fraction = ReadoutFraction(pixel, stated);
  const SeenPoint point = See(camera, InWorld(state), calibration.readout_s[0] * fraction);
  if (point.p.z() < kNearestPoint_m) return std::numeric_limits<double>::infinity();
  const SeenPixel seen = ProjectCorrected(stated, calibration.lens, point.p);
  return 0.5 * CauchyLoss(Residual(calibration, seen).squaredNorm(), kCornerLossScale);
}

}  // namespace plumb::bundle
