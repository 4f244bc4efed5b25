// SPDX-License-Identifier: Apache-2.0
// What each depth image of a sensor errs by on its own.
#pragma once

#include "algo/sensor_model/depth_sensor.hpp"

namespace plumb {

/// Standard deviations of the error of depth images beside the calibration: of each image's own,
/// and of what all images of a sweep share. 0: the class has none.
struct ImageErrorSigmas {
  double offset_m = 0.0;
  double tilt = 0.0;  ///< Fraction of the depth per half image width.
  /// Of the error that depends on the depth alone and is the same in all images.
  double curve_m = 0.0;
  /// What the model leaves of a body's angle in one scan: about the two level axes and about the
  /// upright one, radians.
  double body_tilt_rad = 0.0;
  double body_turn_rad = 0.0;
  double body_shift_m = 0.0;  ///< Of its place along the two level axes, in the same way.
};

/// Part of the table of classes, see ClassOf().
[[nodiscard]] const ImageErrorSigmas& ImageErrorSigmasOf(DepthSensor sensor);

}  // namespace plumb
