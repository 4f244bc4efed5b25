// SPDX-License-Identifier: Apache-2.0
#include "algo/bundle/keypoint_term.hpp"

#include <cmath>
#include <limits>

#include "algo/base/robust_weights.hpp"

namespace plumb::bundle {
namespace {

// Offset from a keypoint's pixel to where the depth image shows it.
// @param pixel_velocity  Of the point in the image, pixels per second.
// @param later_s  Time by which the depth is read later.
Eigen::Vector2d DepthOffset(const Intrinsics& stated, const CalibrationModel& calibration,
                            const Eigen::Vector2d& pixel_velocity, double later_s) {
  const Eigen::Vector2d shift_px(calibration.depth[kDepthShiftX], calibration.depth[kDepthShiftY]);
  return stated.width / 640.0 * shift_px + later_s * pixel_velocity;
}

}  // namespace

double KeypointTerm::DepthDelay(const CalibrationModel& calibration) const {
  return depth_after_color_s + calibration.depth[kDepthDelay] +
         place.row_fraction * calibration.depth[kDepthReadout];
}

KeypointTerm::Rows KeypointTerm::Linearise(const Intrinsics& stated,
                                           const CalibrationModel& calibration,
                                           const CameraState& camera,
                                           const Eigen::Vector3d& p_world) const {
  Rows rows;
  const double row_s = calibration.readout_s[0] * place.row_fraction;
  const SeenPoint point = See(camera, p_world, row_s);
  const SeenPixel seen = ProjectCorrected(stated, calibration.lens, point.p);
  const Eigen::Vector2d r = (seen.pixel - pixel) * weight_px;
  const double w = weight_px * std::sqrt(CauchyWeight(r.squaredNorm(), kKeypointLossScale));
  const Eigen::Matrix<double, 2, 3> J = w * seen.J_point;
  rows.r.head<2>() = w * (seen.pixel - pixel);
  rows.J_point.topRows<2>().noalias() = J * point.J_world;
  rows.J_camera.topRows<2>() = J * point.J_pose;
  rows.J_lens.leftCols<CalibrationModel::kLensSize>() = w * seen.J_lens;
  rows.J_lens.col(kReadoutAt) = place.row_fraction * (J * point.J_time);
  if (!(depth.z_m > 0)) {
    rows.r[2] = 0.0;
    rows.J_point.row(2).setZero();
    rows.J_camera.row(2).setZero();
    rows.J_depth.setZero();
    return rows;
  }
  const double late_s = DepthDelay(calibration);
  const SeenPoint late = See(camera, p_world, late_s);
  const PredictedDepth predicted = PredictDepth(calibration, late, place);
  const Eigen::Vector2d pixel_velocity = seen.J_point * point.J_time;
  const DepthBeside measured(depth,
                             DepthOffset(stated, calibration, pixel_velocity, late_s - row_s));
  const double rz = (predicted.z_m - measured.z_m) * weight_z;
  const double wz = weight_z * std::sqrt(CauchyWeight(rz * rz, kKeypointLossScale));
  rows.r[2] = wz * (predicted.z_m - measured.z_m);
  rows.J_point.row(2) = wz * predicted.J_z * late.J_world.row(2);
  rows.J_camera.row(2) = wz * predicted.J_z * late.J_pose.row(2);
  // The change of the offset with poses and the colour image's readout is of second order.
  rows.J_depth = predicted.J_depth;
  const double scale = stated.width / 640.0;
  rows.J_depth[kDepthShiftX] -= scale * measured.J_offset.x();
  rows.J_depth[kDepthShiftY] -= scale * measured.J_offset.y();
  const double by_time = measured.J_offset * pixel_velocity;
  rows.J_depth[kDepthDelay] -= by_time;
  rows.J_depth[kDepthReadout] -= by_time * place.row_fraction;
  rows.J_depth *= wz;
  return rows;
}

double KeypointTerm::Cost(const Intrinsics& stated, const CalibrationModel& calibration,
                          const CameraState& camera, const Eigen::Vector3d& p_world) const {
  const Eigen::Vector3d p = camera.T_camera_world * p_world;
  const Eigen::Vector3d motion =
      -(camera.velocity_per_s.head<3>().cross(p) + camera.velocity_per_s.tail<3>());
  const Eigen::Vector3d at_row = p + calibration.readout_s[0] * place.row_fraction * motion;
  if (at_row.z() < kNearestPoint_m) return std::numeric_limits<double>::infinity();
  const SeenPixel seen = ProjectCorrected(stated, calibration.lens, at_row);
  const Eigen::Vector2d r = (seen.pixel - pixel) * weight_px;
  double cost = 0.5 * CauchyLoss(r.squaredNorm(), kKeypointLossScale);
  if (depth.z_m > 0) {
    const double late_s = DepthDelay(calibration);
    const double row_s = calibration.readout_s[0] * place.row_fraction;
    const DepthBeside measured(
        depth, DepthOffset(stated, calibration, seen.J_point * motion, late_s - row_s));
    const double rz =
        (PredictDepthOnly(calibration, p.z() + late_s * motion.z(), place) - measured.z_m) *
        weight_z;
    cost += 0.5 * CauchyLoss(rz * rz, kKeypointLossScale);
  }
  return cost;
}

}  // namespace plumb::bundle
