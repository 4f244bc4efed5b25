// SPDX-License-Identifier: Apache-2.0
// What a bundle adjustment moves, and how far it trusts the observations.
#pragma once

#include <stop_token>
#include <vector>

#include "algo/sensor_calibration/calibration_prior.hpp"
#include "algo/sensor_model/depth_noise.hpp"

namespace plumb {

struct BundleOptions {
  /// Keyframes to move; the others that share landmarks or markers are fixed.
  std::vector<int> free_keyframes;
  bool calibrate = false;  ///< Also estimate the calibration.
  /// Even then keep CalibrationModel::lens fixed, except its focal lengths.
  bool fix_centre_and_distortion = false;
  bool fix_depth_field = false;               ///< Keep the depth terms from kDepthField on fixed.
  CalibrationPrior prior = PriorOfAnyUnit();  ///< Prior of the calibration.
  bool keep_witnesses_out = false;            ///< Leave out what IsWitness() selects.
  /// Fill BundleSummary::information and posterior. Markers that only fixed keyframes see are then
  /// free too.
  bool find_information = false;
  int max_iterations = 8;  ///< Steps taken; one that is too long is shortened up to 12 times.
  double function_tolerance = 1e-5;  ///< Iteration ends when the relative decrease is smaller.
  /// Damping of the first step, relative to the diagonal. Along some directions poses and
  /// calibration change together, and the residuals determine these a million times more weakly
  /// than either alone: greater damping needs many steps there, smaller damping may leave the
  /// region in which a poor start converges.
  double initial_damping = 1e-4;
  double keypoint_sigma_px = 0.6;  ///< In pixels at 640 columns.
  double keypoint_depth_sigmas =
      1.5;  ///< Standard deviation of a keypoint's depth relative to `depth_noise`.
  /// Standard deviation of an error that all readings of one depth image share, metres.
  double shared_depth_sigma_m = 0.0;
  DepthNoise depth_noise = {};  ///< The sensor's, see StreamInfo.
  double min_corner_sigma_px = 0.05;
  double marker_length_m = 0.0;  ///< Required: the room's, see CornersInMarkerFrame().
  std::stop_token stop = {};     ///< Polled in each iteration.
};

}  // namespace plumb
