// SPDX-License-Identifier: Apache-2.0
// Bundle adjustment over keyframes, landmarks, markers and the sensor's own calibration.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "algo/bundle/bundle_options.hpp"
#include "algo/bundle/quadratic_term.hpp"
#include "algo/map/map.hpp"
#include "algo/sensor_calibration/calibration_prior.hpp"

namespace plumb {

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
  int num_shortened = 0;  ///< Steps that would not have reduced the cost, or could not be found.
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
