// Bundle adjustment over keyframes, landmarks, markers and the sensor's own calibration.
#pragma once

#include <map>
#include <optional>
#include <stop_token>
#include <vector>

#include "algo/sensor_model/calibration_prior.hpp"
#include "algo/tracking/map.hpp"
#include "algo/types/depth_noise.hpp"

namespace plumb {

/// A quadratic form in the twists of two keyframes (or of one keyframe and a marker), the focal
/// lengths and the depth calibration: 1/2 x' H x + g' x. Here x holds the twists from the poses at
/// the time of linearisation (on the camera's or the marker's side) and the changes of the first
/// kFocal entries of CalibrationModel::lens and of CalibrationModel::depth. Sums of millions of
/// point-to-plane residuals are passed in this form.
struct QuadraticTerm {
  // Of the unknowns: the twist of keyframe a and that of keyframe b or the marker, rotations first;
  // focal lengths; the calibration's depth terms.
  static constexpr int kTwistA = 0;
  static constexpr int kTwistB = 6;
  static constexpr int kFocal = 2;
  static constexpr int kFocalAt = 12;
  static constexpr int kDepthCalibrationAt = kFocalAt + kFocal;
  static constexpr int kSize = kDepthCalibrationAt + CalibrationModel::kDepthSize;
  int keyframe_a = 0;
  /// Exactly one of these two is set.
  std::optional<int> keyframe_b;
  std::optional<int> marker;  ///< Id of the marker.
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
  bool keep_witnesses_out = false;            ///< Leave out what IsWitness() selects.
  /// Fill BundleSummary::information and posterior. Markers that only fixed keyframes see are then
  /// free too.
  bool find_information = false;
  int max_iterations = 8;
  double function_tolerance = 1e-5;  ///< Iteration ends when the relative decrease is smaller.
  /// Damping of the first step, relative to the diagonal. Along some directions poses and
  /// calibration change together, and the residuals determine these a million times more weakly
  /// than either alone: greater damping needs many steps there, smaller damping may leave the
  /// region in which a poor start converges.
  double initial_damping = 1e-4;
  double keypoint_sigma_px = 0.6;  ///< In pixels at 640 columns.
  double keypoint_depth_sigmas =
      1.5;  ///< Standard deviation of a keypoint's depth relative to `depth_noise`.
  DepthNoise depth_noise = {};  ///< The sensor's, see StreamInfo.
  double min_corner_sigma_px = 0.05;
  double marker_length_m = 0.0;  ///< Required: the room's, see CornersInMarkerFrame().
  std::stop_token stop = {};     ///< Polled in each iteration.
};

/// Posterior covariance with the calibration of all that a bundle adjustment moves: twists on the
/// cameras' and the markers' side (rotation vector, translation), then the calibration itself.
/// Landmarks are eliminated.
struct BundlePosterior {
  /// No rows where the calibration was not free.
  Eigen::Matrix<double, Eigen::Dynamic, kCalibrationSize> with_calibration;
  /// Covariance of the markers' twists with each other, 6 rows and columns for each in the order
  /// of `marker_rows`: cameras and calibration are eliminated too. In the frame of the keyframes
  /// that were fixed.
  Eigen::MatrixXd of_markers;
  /// First row of each keyframe. A keyframe that was fixed has none.
  std::vector<std::optional<Eigen::Index>> camera_rows;
  std::map<int, Eigen::Index> marker_rows;  ///< By id.

  [[nodiscard]] bool empty() const { return with_calibration.rows() == 0; }
  [[nodiscard]] std::optional<Eigen::Index> CameraAt(int keyframe) const {
    return camera_rows[static_cast<std::size_t>(keyframe)];
  }
  /// A marker that took no part has no row.
  [[nodiscard]] std::optional<Eigen::Index> MarkerAt(int id) const {
    const auto found = marker_rows.find(id);
    if (found == marker_rows.end()) return std::nullopt;
    return found->second;
  }
  [[nodiscard]] CalibrationMatrix calibration() const {
    return with_calibration.bottomRows<kCalibrationSize>();
  }
};

struct BundleSummary {
  int num_iterations = 0;
  double initial_cost = 0;
  double final_cost = 0;
  /// Information of the residuals alone about the calibration, with all other unknowns free and
  /// eliminated; zero if the equations could not be solved.
  CalibrationMatrix information = CalibrationMatrix::Zero();
  BundlePosterior posterior;  ///< Empty where the equations could not be solved.
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
