// SPDX-License-Identifier: Apache-2.0
// The scene's dependence on the sensor's calibration, from the joint solve's own equations.
#pragma once

#include "algo/bundle/bundle_adjustment.hpp"
#include "algo/registration/depth_views.hpp"
#include "algo/sensor_model/sensor_sensitivity.hpp"

namespace plumb {

/// With the calibration moved by d, the solution of the joint solve moves by C_xc C_cc^-1 d, where
/// C is the posterior covariance of poses, markers and calibration: the conditional mean of a
/// normal distribution. Surface patches are what the depth images show under those poses, in cubes
/// of the scene's frame.
/// @param map  As the joint solve left it.
/// @param depth_errors  How the errors of single depth images follow the calibration; or empty.
/// @param reference_marker  Id of the marker of the map whose frame is the scene's.
[[nodiscard]] SensorSensitivity SensitivityOf(const Intrinsics& stated,
                                              const CalibrationModel& calibration,
                                              const BundlePosterior& posterior,
                                              const dense::DepthErrorColumns& depth_errors,
                                              const TrackingMap& map, int reference_marker);

}  // namespace plumb
