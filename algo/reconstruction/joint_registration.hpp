// All keyframes, landmarks, markers and the sensor's calibration in one least-squares problem with
// dense depth.
#pragma once

#include <functional>
#include <stop_token>

#include "algo/sensor_model/sensor_profile.hpp"
#include "algo/tracking/bundle_adjustment.hpp"

namespace plumb {

struct JointRegistrationOptions {
  double marker_length_m = 0.104;
  bool calibrate = true;        ///< Estimate the sensor's calibration with the poses.
  bool use_depth_field = true;  ///< false: without the terms from kDepthField on.
  bool use_dense = true;        ///< false: keypoints and markers only.
  int num_rounds = 5;           ///< Of association and solution.
  double max_gate_m =
      0.06;  ///< Farthest point-to-plane residual of the first round; shrinks by 0.6 a round.
  double min_gate_m = 0.012;
  double settled_m = 0.001;  ///< A round that moves no camera farther is the last one.
  int max_pairs = 8;         ///< Overlapping keyframes that each keyframe is registered against.
  double min_overlap = 0.2;  ///< Share of a keyframe's cells that fall into the other.
  /// Of the dense terms against their noise model: what the model leaves out is shared by
  /// neighbouring cells and views.
  double dense_weight = 0.1;
  /// Pixels at 640 columns. Above the noise of one sighting: a track's error is common to its
  /// views.
  double keypoint_sigma_px = 0.4;
  /// In standard deviations of the noise model. Above one: what a track triangulates is off by an
  /// error that all its views share.
  double keypoint_depth_sigmas = 2.0;
  CalibrationPrior prior = PriorOfAnyUnit();
  bool find_evidence = false;  ///< Fill JointRegistrationResult::evidence.
  /// Called before each round: makes the keyframes' velocities follow their poses.
  std::function<void(TrackingMap&)> refresh_velocities = {};
  /// Then find each keyframe's velocity from the rows of its own image: RefineVelocities().
  bool use_row_motion = true;
  /// Of bundle adjustment with new velocities, before the dense rounds: the lens is found here.
  int num_velocity_rounds = 2;
};

struct JointRegistrationResult {
  CalibrationModel calibration;
  bool accepted = false;  ///< False: held-out points agreed better before; the map is as bundle
                          ///< adjustment left it.
  double consistency_before_m =
      0.0;  ///< Median point-to-plane residual of held-out cells between overlapping keyframes.
  double consistency_after_m = 0.0;
  int num_pairs = 0;
  SweepEvidence evidence;  ///< About the sensor.
};

/// Refines the map in place: bundle adjustment with the calibration free, then rounds of projective
/// association (dense point-to-plane between overlapping keyframes, and depth on the markers' own
/// faces) and joint solution. Keyframe 0 is the gauge. Deterministic whatever the number of
/// threads. @throws Interrupted on a stop request.
[[nodiscard]] JointRegistrationResult RegisterJointly(const Intrinsics& stated,
                                                      const JointRegistrationOptions& options,
                                                      TrackingMap& map,
                                                      const std::stop_token& stop = {});

/// Camera pose of a keyframe at its depth stamp.
[[nodiscard]] Pose DepthPose(const MapKeyframe& keyframe, const CalibrationModel& calibration);

}  // namespace plumb
