// Bundle adjustment over keyframes, landmarks, markers and the sensor's own calibration.
#pragma once

#include <stop_token>
#include <vector>

#include "algo/sensor_model/calibration_prior.hpp"
#include "algo/tracking/map.hpp"

namespace plumb {

/// A quadratic form in the twists of two keyframes (or of one keyframe and a marker), the focal
/// lengths and the depth calibration: 1/2 x' H x + g' x. Here x holds the twists from the poses at
/// the time of linearisation (on the camera's or the marker's side) and the changes of the first
/// kFocal entries of CalibrationModel::lens and of CalibrationModel::depth. Sums of millions of
/// point-to-plane residuals are passed in this form.
struct QuadraticTerm {
  static constexpr int kFocal = 2;
  static constexpr int kFocalAt = 12;
  static constexpr int kDepthCalibrationAt = kFocalAt + kFocal;
  static constexpr int kSize = kDepthCalibrationAt + CalibrationModel::kDepthSize;
  int keyframe_a = -1;
  int keyframe_b = -1;  ///< Second keyframe, or -1 where `marker` is the second.
  int marker = -1;      ///< Id of the marker.
  Eigen::Matrix<double, kSize, kSize> H = Eigen::Matrix<double, kSize, kSize>::Zero();
  Eigen::Matrix<double, kSize, 1> g = Eigen::Matrix<double, kSize, 1>::Zero();
};

struct BundleOptions {
  /// Keyframes to move; the others that share landmarks or markers are fixed.
  std::vector<int> free_keyframes;
  bool calibrate = false;  ///< Also estimate the calibration.
  /// Even then keep CalibrationModel::lens fixed, except its focal lengths.
  bool fix_centre_and_distortion = false;
  bool fix_depth_field = false;               ///< Keep the depth terms from kDepthField on fixed.
  CalibrationPrior prior = PriorOfAnyUnit();  ///< Prior of the calibration.
  bool find_information = false;              ///< Fill BundleSummary::information.
  int max_iterations = 8;
  double function_tolerance = 1e-5;  ///< Iteration ends when the relative decrease is smaller.
  double keypoint_sigma_px = 0.6;    ///< In pixels at 640 columns.
  double keypoint_depth_sigmas =
      1.5;  ///< Standard deviation of a keypoint's depth relative to the noise model.
  double min_corner_sigma_px = 0.05;
  double marker_length_m = 0.104;
  std::stop_token stop = {};  ///< Polled in each iteration.
};

struct BundleSummary {
  bool usable = false;
  int num_residuals = 0;
  int num_iterations = 0;
  double initial_cost = 0;
  double final_cost = 0;
  /// Information of the residuals alone about the calibration, with all other unknowns free and
  /// eliminated; zero if the equations could not be solved.
  CalibrationMatrix information = CalibrationMatrix::Zero();
};

/// Optimises what the options leave free, in place, by Levenberg-Marquardt with Cauchy weights;
/// landmarks are eliminated (Schur complement). Runs in parallel on TBB's threads and is
/// deterministic on any number of them. A general-purpose solver reached the same minima, but
/// repeats its results bit for bit on one thread only.
/// @param terms  Linearised at the present values of the map and the calibration.
/// @throws Interrupted on a stop request; the map is then unchanged.
BundleSummary BundleAdjust(const Intrinsics& stated, const BundleOptions& options,
                           const std::vector<QuadraticTerm>& terms, TrackingMap& map,
                           CalibrationModel& calibration);

}  // namespace plumb
