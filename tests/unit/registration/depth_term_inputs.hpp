// SPDX-License-Identifier: Apache-2.0
// Two depth images of the synthetic landscape under a calibration and poses that a test moves.
#pragma once

#include <vector>

#include "algo/registration/depth_views.hpp"
#include "tests/unit/tracking/synthetic_map.hpp"

namespace plumb::dense {

struct MovedViews {
  /// @param calibration  On top of a calibration with errors of every kind that the cells have.
  /// @param twist_0, twist_1  Of the first two keyframes, on the cameras' side.
  MovedViews(const synthetic::TrueMap& truth, const CalibrationVector& calibration,
             const Vector6d& twist_0, const Vector6d& twist_1)
      : map(truth.map) {
    CalibrationModel model;
    model.depth = {0.01, 0.004, -0.003, 0.4, -0.3, 0.003, 0.002, -0.0015, 0.02};
    MoveCalibration(calibration, model);
    map.keyframes[0].velocity_per_s << 0.1, -0.2, 0.1, 0.15, -0.1, 0.2;
    map.keyframes[1].velocity_per_s << -0.2, 0.1, 0.1, -0.1, 0.2, 0.1;
    map.keyframes[0].T_world_color = map.keyframes[0].T_world_color * PoseFromTwist(twist_0);
    map.keyframes[1].T_world_color = map.keyframes[1].T_world_color * PoseFromTwist(twist_1);
    cells = MakeCells(truth.stated, map);
    sensor = MakeSensor(truth.stated, model);
    views = MakeViews(sensor, model, cells, map);
  }
  MovedViews(const MovedViews&) = delete;
  MovedViews& operator=(const MovedViews&) = delete;

  TrackingMap map;
  Cells cells;
  Sensor sensor;
  std::vector<View> views;
};

/// A step in the unknowns of a QuadraticTerm, as that of a calibration.
inline CalibrationVector CalibrationStep(const QuadraticTerm::Vector& step) {
  CalibrationVector calibration = CalibrationVector::Zero();
  calibration.segment<QuadraticTerm::kFocal>(kLensAt) =
      step.segment<QuadraticTerm::kFocal>(QuadraticTerm::kFocalAt);
  calibration.tail<CalibrationModel::kDepthSize>() = step.tail<CalibrationModel::kDepthSize>();
  return calibration;
}

/// Views are in single precision: a step must be that long, and differences scatter by about 1e-4.
inline constexpr double kLongStep = 1e-3;

}  // namespace plumb::dense
