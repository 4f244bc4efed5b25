// Solves all keyframes, landmarks, markers and the sensor's calibration in one least-squares
// problem with dense depth.
#pragma once

#include <functional>
#include <map>
#include <stop_token>

#include "algo/sensor_model/sensor_profile.hpp"
#include "algo/tracking/bundle_adjustment.hpp"
#include "algo/tracking/witnesses.hpp"
#include "algo/types/depth_noise.hpp"

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
};

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
  /// algo/README.md).
  BundlePosterior posterior;
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

/// Camera pose of a keyframe at its depth stamp.
[[nodiscard]] Pose DepthPose(const MapKeyframe& keyframe, const CalibrationModel& calibration);

}  // namespace plumb
