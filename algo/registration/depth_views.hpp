// SPDX-License-Identifier: Apache-2.0
// The keyframes' depth under a calibration, and how its points move with the calibration.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "algo/bundle/quadratic_term.hpp"
#include "algo/map/map.hpp"
#include "algo/registration/depth_errors.hpp"
#include "algo/sensor_calibration/calibration_prior.hpp"
#include "algo/sensor_calibration/depth_field.hpp"

namespace plumb {

/// Camera pose of a keyframe at its depth stamp.
[[nodiscard]] Pose DepthPose(const MapKeyframe& keyframe, const CalibrationModel& calibration);

}  // namespace plumb

namespace plumb::dense {

/// Positions of the cells of every keyframe in the depth model.
struct Cells {
  std::vector<Eigen::Vector2f> centred;  ///< Centred image coordinates, row by row.
  std::vector<FieldRow> products;
};

/// The cameras under one calibration.
struct Sensor {
  Intrinsics stated;
  Intrinsics corrected;  ///< Of the colour camera.
  Intrinsics depth;      ///< The same with the shift of the depth image.
  double scale = 1;      ///< Pixels of this image per pixel of an image of 640 columns.
};

/// A keyframe under the calibration of the current round.
struct View {
  const MapKeyframe* keyframe = nullptr;
  Pose T_world_depth;
  Pose T_color_depth;
  /// Corrected, in the depth camera's frame; z is 0 where nothing was measured.
  std::vector<Eigen::Vector3f> points;
  /// DepthCorrection::Slope() where something was measured.
  std::vector<float> slopes;
  const Cells* cells = nullptr;
  int width = 0;
  int height = 0;
};

Cells MakeCells(const Intrinsics& stated, const TrackingMap& map);

Sensor MakeSensor(const Intrinsics& stated, const CalibrationModel& calibration);

/// @param cells, map  Must outlive the views.
std::vector<View> MakeViews(const Sensor& sensor, const CalibrationModel& calibration,
                            const Cells& cells, const TrackingMap& map,
                            const DepthErrors& errors = {});

/// Derivative of a cell's point in its own depth camera with the focal lengths, in the first two
/// columns of the lens, and the depth calibration.
Eigen::Matrix<double, 3, kCalibrationSize> CellJacobian(const Sensor& sensor, const View& view,
                                                        std::size_t cell);

using DepthVector = Eigen::Matrix<double, CalibrationModel::kDepthSize, 1>;

/// Derivative of a cell's corrected depth with respect to the depth calibration, except for its
/// times and shifts, which also move the point sideways.
[[nodiscard]] DepthVector DepthJacobian(const View& view, std::size_t cell);

/// Derivative of View::slopes with respect to the depth calibration.
[[nodiscard]] DepthVector SlopeJacobian(const View& view, std::size_t cell);

/// Derivative of a corrected point's position with respect to the depth calibration, projected onto
/// a direction m of its own camera.
/// @param J_depth  DepthJacobian() of the cell.
[[nodiscard]] DepthVector PositionJacobian(const Sensor& sensor, const View& view, std::size_t cell,
                                           const DepthVector& J_depth, const Eigen::Vector3d& m);

/// The same with respect to the two focal lengths: a longer one moves the point towards the axis.
/// The lens's distortion changes this by a few percent, which only costs a round.
[[nodiscard]] Eigen::Vector2d FocalJacobian(const View& view, std::size_t cell,
                                            const Eigen::Vector3d& m);

}  // namespace plumb::dense
