// SPDX-License-Identifier: Apache-2.0
// The normal equations of a bundle adjustment at one state.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "algo/bundle/bundle_problem.hpp"

namespace plumb::bundle {

using CameraPoint = Eigen::Matrix<double, kCamera, 3>;

/// Parallel loops write to their own slots and every sum has a fixed order: the same bits on any
/// number of threads.
class Equations {
 public:
  /// @param problem  Must outlive this object.
  explicit Equations(const Problem& problem);

  /// Computes all of the members below.
  void Linearise(const State& state);

  /// One for each of Problem::keypoints.
  [[nodiscard]] const std::vector<KeypointTerm::Rows>& rows() const { return rows_; }
  /// Normal equations of poses, markers and calibration, undamped, lower half; landmarks are not
  /// yet eliminated.
  [[nodiscard]] const Eigen::MatrixXd& H() const { return H_; }
  [[nodiscard]] const Eigen::VectorXd& g() const { return g_; }

 private:
  void LineariseKeyframe(const State& state, std::size_t k, CalibrationMatrix& H_calibration,
                         CalibrationVector& g_calibration);
  // The corners that one keyframe sees: its own pose and its coupling to the markers.
  void AddCornersOfKeyframe(std::size_t k, CalibrationMatrix& H_calibration,
                            CalibrationVector& g_calibration);
  void AddCornersOfMarker(std::size_t slot);
  /// @param slope  H x + g of the term at the state.
  void AddTerm(const QuadraticTerm& term, const QuadraticTerm::Vector& slope);

  const Problem& problem_;
  std::vector<KeypointTerm::Rows> rows_;
  std::vector<CornerTerm::Rows> corner_rows_;
  Eigen::MatrixXd H_;
  Eigen::VectorXd g_;
};

}  // namespace plumb::bundle
