// Bundle adjustment over keyframes, landmarks, markers and the sensor's own calibration.
#pragma once

#include <stop_token>
#include <vector>

#include "algo/sensor_model/calibration_prior.hpp"
#include "algo/tracking/map.hpp"

namespace plumb {

/// A quadratic in the twists of two keyframes (or of one keyframe and a marker), the focal lengths
/// and the depth calibration: 1/2 x' H x + g' x, where x holds the twists from the poses at the
/// time of linearisation (twist on the camera's or the marker's side) and the changes of the first
/// kFocal entries of CalibrationModel::lens and of CalibrationModel::depth. Sums of millions of
/// point-to-plane residuals come in this form.
struct QuadraticTerm {
  static constexpr int kFocal = 2;
  static constexpr int kFocalAt = 12;
  static constexpr int kDepthCalibrationAt = kFocalAt + kFocal;
  static constexpr int kSize = kDepthCalibrationAt + CalibrationModel::kDepthSize;
  int keyframe_a = -1;
  int keyframe_b = -1;  ///< Second keyframe, or -1 where `marker` is the second.
  int marker = -1;      ///< Id.
  Eigen::Matrix<double, kSize, kSize> H = Eigen::Matrix<double, kSize, kSize>::Zero();
  Eigen::Matrix<double, kSize, 1> g = Eigen::Matrix<double, kSize, 1>::Zero();
};

struct BundleOptions {
  std::vector<int> free_keyframes;  ///< To move; the others that share landmarks or markers stay.
  bool calibrate = false;           ///< Move the calibration too.
  /// Keep CalibrationModel::lens but for its focal lengths even so.
  bool fix_centre_and_distortion = false;
  bool fix_depth_field = false;               ///< Keep the depth terms from kDepthField on.
  CalibrationPrior prior = PriorOfAnyUnit();  ///< Of the calibration.
  bool find_information = false;              ///< Fill BundleSummary::information.
  int max_iterations = 8;
  double function_tolerance = 1e-5;  ///< Relative decrease that is not worth another iteration.
  double keypoint_sigma_px = 0.6;    ///< At 640 columns.
  double keypoint_depth_sigmas =
      1.5;  ///< Standard deviation of a keypoint's depth, in those of the noise model.
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
  /// Of the residuals alone about the calibration, all else free and eliminated; zero where the
  /// equations could not be solved.
  CalibrationMatrix information = CalibrationMatrix::Zero();
};

/// Moves what the options free, in place, by Levenberg-Marquardt with Cauchy weights; landmarks are
/// eliminated (Schur complement). Spread over TBB's threads; deterministic, whatever their number.
/// A general solver came to the same minima, but repeats its bits on one thread only.
/// @param terms  Linearised at the map's and the calibration's present values.
/// @throws Interrupted on a stop request; nothing has moved then.
BundleSummary BundleAdjust(const Intrinsics& stated, const BundleOptions& options,
                           const std::vector<QuadraticTerm>& terms, TrackingMap& map,
                           CalibrationModel& calibration);

}  // namespace plumb
