// SPDX-License-Identifier: Apache-2.0
// Options of the joint solve.
#pragma once

#include <algorithm>
#include <functional>

#include "algo/map/map.hpp"
#include "algo/sensor_calibration/calibration_prior.hpp"
#include "algo/sensor_model/depth_noise.hpp"

namespace plumb {

struct JointRegistrationOptions {
  double marker_length_m = 0.0;  ///< Required: the room's, see CornersInMarkerFrame().
  bool calibrate = true;         ///< Estimate the sensor's calibration together with the poses.
  bool use_depth_field = true;   ///< False: without the terms from kDepthField on.
  bool use_dense = true;         ///< False: keypoints and markers only.
  int num_rounds = 5;            ///< Largest number of dense rounds, the coarse one included.
  /// Largest point-to-plane residual of the first round; multiplied by 0.6 in each round.
  double max_gate_m = 0.06;
  double min_gate_m = 0.012;
  double settled_m = 0.002;     ///< The rounds end when no camera moves farther than this.
  int max_pairs = 8;            ///< Overlapping keyframes with which each keyframe is registered.
  double min_overlap = 0.2;     ///< Fraction of a keyframe's cells that project into the other.
  DepthNoise depth_noise = {};  ///< The sensor's, see StreamInfo.
  /// Weight of the dense terms relative to their noise model, because errors outside the model are
  /// shared by neighbouring cells and views.
  double dense_weight = 0.1;
  double correlation_px = 9.0;  ///< Of the noise of depth, see DepthSensorClass.
  /// Prior of each depth image's own offset (metres) and tilt (fraction of the depth per half
  /// width); 0: the images of one sweep err alike.
  double image_offset_sigma_m = 0.0;
  double image_tilt_sigma = 0.0;
  /// Prior of each knot of the DepthCurve that all images share, metres; 0: there is none. Needs
  /// errors of single images.
  double depth_curve_sigma_m = 0.0;
  /// Pixels at 640 columns. Larger than the noise of one observation, because the error of a track
  /// is common to its views.
  double keypoint_sigma_px = 0.4;
  /// In standard deviations of the noise model. Greater than one, because the triangulation of a
  /// track has an error that all its views share.
  double keypoint_depth_sigmas = 2.0;
  CalibrationPrior prior = PriorOfAnyUnit();
  /// Called before each round; updates the keyframes' velocities from their poses.
  std::function<void(TrackingMap&)> refresh_velocities = {};
  /// Whether RefineVelocities() then estimates each keyframe's velocity from the rows of its own
  /// image.
  bool use_row_motion = true;
  /// Rounds of bundle adjustment with new velocities before the dense rounds, in which the lens is
  /// estimated.
  int num_velocity_rounds = 2;

  [[nodiscard]] bool HasImageErrors() const { return image_offset_sigma_m > 0; }
  /// Information of a cell relative to one whose noise reaches as far as that of the sensors for
  /// which `dense_weight` was chosen.
  [[nodiscard]] double DenseInformation() const {
    constexpr double kUsual_px = 10.0;
    const double ratio = kUsual_px / correlation_px;
    return std::min(1.0, ratio * ratio);
  }
};

}  // namespace plumb
