// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/depth_views.hpp"

#include <tbb/parallel_for.h>

#include "algo/sensor_calibration/depth_correction.hpp"

namespace plumb {

Pose DepthPose(const MapKeyframe& keyframe, const CalibrationModel& calibration) {
  return PoseAfter(
      keyframe.T_world_color, keyframe.velocity_per_s,
      keyframe.data.depth_time_s - keyframe.data.color_time_s + calibration.depth[kDepthDelay]);
}

}  // namespace plumb

namespace plumb::dense {

DepthVector DepthJacobian(const View& view, std::size_t i) {
  const double z_raw = view.keyframe->dense.z_m[i];
  const Eigen::Vector2f& centred = view.cells->centred[i];
  const FieldRow& products = view.cells->products[i];
  DepthVector J = DepthVector::Zero();
  J[kDepthScale] = z_raw;
  J[kDepthOffset] = 1.0;
  J[kDepthBow] = centred.squaredNorm();
  J[kDepthSlopeX] = z_raw * centred.x();
  J[kDepthSlopeY] = z_raw * centred.y();
  J.segment<kNumFieldTerms>(kDepthField) = z_raw * products.head<kNumFieldTerms>().cast<double>();
  J.segment<kNumGrowthTerms>(kDepthGrowth) =
      z_raw * FieldGrowth(z_raw) * products.tail<kNumGrowthTerms>().cast<double>();
  return J;
}

DepthVector SlopeJacobian(const View& view, std::size_t i) {
  const double z_raw = view.keyframe->dense.z_m[i];
  const Eigen::Vector2f& centred = view.cells->centred[i];
  const FieldRow& products = view.cells->products[i];
  DepthVector J = DepthVector::Zero();
  J[kDepthScale] = 1.0;
  J[kDepthSlopeX] = centred.x();
  J[kDepthSlopeY] = centred.y();
  J.segment<kNumFieldTerms>(kDepthField) = products.head<kNumFieldTerms>().cast<double>();
  J.segment<kNumGrowthTerms>(kDepthGrowth) =
      (FieldGrowth(z_raw) + z_raw * FieldGrowthSlope(z_raw)) *
      products.tail<kNumGrowthTerms>().cast<double>();
  return J;
}

DepthVector PositionJacobian(const Sensor& sensor, const View& view, std::size_t i,
                             const DepthVector& J_depth, const Eigen::Vector3d& m) {
  const Eigen::Vector3d p = view.points[i].cast<double>();
  DepthVector J = m.dot(p) / p.z() * J_depth;
  J[kDepthShiftX] = -m.x() * p.z() * sensor.scale / sensor.depth.fx;
  J[kDepthShiftY] = -m.y() * p.z() * sensor.scale / sensor.depth.fy;
  const Vector6d& v = view.keyframe->velocity_per_s;
  const double along_motion = m.dot(v.head<3>().cross(p) + v.tail<3>());
  J[kDepthDelay] = along_motion;
  const auto width = static_cast<std::size_t>(view.width);
  const auto line = static_cast<double>(ReadByColumns(sensor.stated) ? i % width : i / width);
  const int num_lines = ReadByColumns(sensor.stated) ? view.width : view.height;
  J[kDepthReadout] = along_motion * ((line + 0.5) / num_lines - 0.5);
  return J;
}

Eigen::Vector2d FocalJacobian(const View& view, std::size_t i, const Eigen::Vector3d& m) {
  return -m.head<2>().cwiseProduct(view.points[i].head<2>().cast<double>());
}

Cells MakeCells(const Intrinsics& stated, const TrackingMap& map) {
  const DenseView& first = map.keyframes[0].dense;
  Cells cells;
  for (int r = 0; r < first.height; ++r)
    for (int c = 0; c < first.width; ++c)
      cells.centred.push_back(CentredCoordinates((c + 0.5) * first.window_px - 0.5,
                                                 (r + 0.5) * first.window_px - 0.5, stated.width,
                                                 stated.height)
                                  .cast<float>());
  cells.products = FieldProductsOfCells(stated.width, stated.height, first.window_px);
  return cells;
}

Sensor MakeSensor(const Intrinsics& stated, const CalibrationModel& calibration) {
  Sensor sensor;
  sensor.stated = stated;
  sensor.corrected = calibration.Corrected(stated);
  sensor.scale = stated.width / 640.0;
  sensor.depth = sensor.corrected;
  sensor.depth.cx += calibration.depth[kDepthShiftX] * sensor.scale;
  sensor.depth.cy += calibration.depth[kDepthShiftY] * sensor.scale;
  return sensor;
}

std::vector<View> MakeViews(const Sensor& sensor, const CalibrationModel& calibration,
                            const Cells& cells, const TrackingMap& map, const DepthErrors& errors) {
  std::vector<View> views(map.keyframes.size());
  if (map.keyframes.empty()) return views;
  const DenseView& first = map.keyframes[0].dense;
  std::vector<Eigen::Vector2f> rays(first.size());
  const DepthCorrection correction(calibration, sensor.stated.width, sensor.stated.height,
                                   first.window_px);
  tbb::parallel_for(0, first.height, [&](int r) {
    for (int c = 0; c < first.width; ++c) {
      const auto i = static_cast<std::size_t>(r * first.width + c);
      const double x = (c + 0.5) * first.window_px - 0.5;
      const double y = (r + 0.5) * first.window_px - 0.5;
      rays[i] = Undistort(sensor.depth, {x, y}).cast<float>();
    }
  });
  // Lines are read out one after the other: each cell is moved to where the camera at the stamp
  // would see it.
  const auto readout_s = static_cast<float>(calibration.depth[kDepthReadout]);
  const bool by_columns = ReadByColumns(sensor.stated);
  const int num_lines = by_columns ? first.width : first.height;
  std::vector<float> line_fraction;
  for (int line = 0; line < num_lines; ++line)
    line_fraction.push_back((static_cast<float>(line) + 0.5F) / static_cast<float>(num_lines) -
                            0.5F);
  tbb::parallel_for(std::size_t{0}, views.size(), [&](std::size_t k) {
    const MapKeyframe& keyframe = map.keyframes[k];
    View& view = views[k];
    view.keyframe = &keyframe;
    view.T_world_depth = DepthPose(keyframe, calibration);
    view.T_color_depth = keyframe.T_world_color.inverse() * view.T_world_depth;
    view.width = keyframe.dense.width;
    view.height = keyframe.dense.height;
    view.cells = &cells;
    view.points.assign(keyframe.dense.size(), Eigen::Vector3f::Zero());
    view.slopes.assign(keyframe.dense.size(), 1.0F);
    const Eigen::Vector3f w = keyframe.velocity_per_s.head<3>().cast<float>();
    const Eigen::Vector3f v = keyframe.velocity_per_s.tail<3>().cast<float>();
    for (std::size_t i = 0; i < view.points.size(); ++i) {
      const float z = keyframe.dense.z_m[i];
      if (z <= 0) continue;
      const double metric = correction.Correct(i, z) + errors.Correction(k, z, cells.centred[i]);
      const auto corrected = static_cast<float>(metric);
      const Eigen::Vector3f p(rays[i].x() * corrected, rays[i].y() * corrected, corrected);
      const auto width = static_cast<std::size_t>(view.width);
      const float late_s = line_fraction[by_columns ? i % width : i / width] * readout_s;
      view.points[i] = p + late_s * (w.cross(p) + v);
      view.slopes[i] = static_cast<float>(correction.Slope(i, z));
    }
  });
  return views;
}

Eigen::Matrix<double, 3, kCalibrationSize> CellJacobian(const Sensor& sensor, const View& view,
                                                        std::size_t cell) {
  Eigen::Matrix<double, 3, kCalibrationSize> J = Eigen::Matrix<double, 3, kCalibrationSize>::Zero();
  const DepthVector J_depth = DepthJacobian(view, cell);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d m = Eigen::Vector3d::Unit(axis);
    J.block<1, QuadraticTerm::kFocal>(axis, kLensAt) = FocalJacobian(view, cell, m).transpose();
    J.block<1, CalibrationModel::kDepthSize>(axis, kDepthAt) =
        PositionJacobian(sensor, view, cell, J_depth, m).transpose();
  }
  return J;
}

}  // namespace plumb::dense
