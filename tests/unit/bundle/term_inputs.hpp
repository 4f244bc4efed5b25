// SPDX-License-Identifier: Apache-2.0
// Inputs of the residual terms' tests: a moving camera with errors of every kind.
#pragma once

#include "algo/bundle/bundle_model.hpp"

namespace plumb::bundle {

inline CameraState SomeCamera() {
  CameraState camera;
  camera.T_camera0_world = PoseFromTwist((Vector6d() << 0.3, -0.2, 0.5, 0.1, -0.4, 0.8).finished());
  camera.velocity_per_s << 0.4, -0.3, 0.2, 0.25, -0.1, 0.3;
  camera.Prepare();
  return camera;
}

inline CameraState Moved(CameraState camera, const Vector6d& by) {
  camera.twist += by;
  camera.Prepare();
  return camera;
}

inline CalibrationModel SomeCalibration() {
  CalibrationModel calibration;
  calibration.lens = {0.002, -0.001, 0.5, -0.7, 0.01, -0.02, 0.003, -0.002};
  calibration.readout_s = {0.02};
  calibration.edge_bias_px = {0.05};
  calibration.depth = {0.01, 0.004, -0.003, 0.4, -0.3, 0.003, 0.002, -0.0015, 0.02};
  return calibration;
}

inline CalibrationModel Moved(CalibrationModel calibration, const CalibrationVector& by) {
  MoveCalibration(by, calibration);
  return calibration;
}

inline const Intrinsics kLens = {
    320, 240, 262.0, 263.0, 158.0, 121.0, {0.06, -0.15, 0.001, -0.0008, 0.03}};

}  // namespace plumb::bundle
