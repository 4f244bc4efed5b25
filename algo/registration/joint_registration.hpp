// SPDX-License-Identifier: Apache-2.0
// Solves all keyframes, landmarks, markers and the sensor's calibration in one least-squares
// problem with dense depth.
#pragma once

#include <map>
#include <stop_token>
#include <vector>

#include "algo/bundle/bundle_adjustment.hpp"
#include "algo/bundle/witnesses.hpp"
#include "algo/registration/depth_views.hpp"
#include "algo/registration/registration_options.hpp"
#include "algo/sensor_calibration/sensor_profile.hpp"

namespace plumb {

struct JointRegistrationResult {
  CalibrationModel calibration;
  /// False: held-out points or witnesses agreed better before, and the map is left as after bundle
  /// adjustment.
  bool accepted = false;
  double consistency_before_m =
      0.0;  ///< Median point-to-plane residual of held-out cells between overlapping keyframes.
  double consistency_after_m = 0.0;
  WitnessErrors witnesses_before;  ///< Of the solution without the dense terms.
  WitnessErrors witnesses_after;
  int num_pairs = 0;
  /// Empty unless accepted and calibrated: without dense terms it is too narrow (see
  /// docs/method-measurements.md).
  BundlePosterior posterior;
  /// The solution without the dense terms, where they were accepted: its calibration, and the depth
  /// cameras' poses at their stamps, by keyframe.
  CalibrationModel sparse_calibration;
  std::vector<Pose> T_world_depth_sparse;
  /// Of the keyframes' depth images, where their class has such.
  dense::DepthErrors depth_errors;
  dense::DepthErrorColumns depth_errors_with_calibration;  ///< Empty where `posterior` is.
  /// MarkerSigmas() of the map as it was left, with or without the dense terms.
  std::map<int, double> marker_sigmas_m;
  SweepEvidence evidence;  ///< Evidence about the sensor's calibration.
};

/// Refines the map in place: bundle adjustment with free calibration, then rounds of projective
/// association (dense point-to-plane distances between overlapping keyframes, and depth on the
/// markers' own faces) and joint solution. Keyframe 0 fixes the gauge. Deterministic on any number
/// of threads.
/// @throws Interrupted on a stop request.
[[nodiscard]] JointRegistrationResult RegisterJointly(const Intrinsics& stated,
                                                      const JointRegistrationOptions& options,
                                                      TrackingMap& map,
                                                      const std::stop_token& stop = {});

}  // namespace plumb
