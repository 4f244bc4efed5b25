// SPDX-License-Identifier: Apache-2.0
#include "algo/bundle/bundle_equations.hpp"

#include <tbb/parallel_for.h>

namespace plumb::bundle {
namespace {

using CameraVector = Eigen::Matrix<double, kCamera, 1>;
using CameraMatrix = Eigen::Matrix<double, kCamera, kCamera>;
using CalibrationCamera = Eigen::Matrix<double, kCalibrationSize, kCamera>;

}  // namespace

Equations::Equations(const Problem& problem) : problem_(problem) {}

void Equations::Linearise(const State& state) {
  rows_.resize(problem_.keypoints.size());
  corner_rows_.resize(problem_.corners.size());
  H_ = Eigen::MatrixXd::Zero(problem_.size, problem_.size);
  g_ = Eigen::VectorXd::Zero(problem_.size);
  std::vector<CalibrationMatrix> H_calibration(problem_.pose_slots.size(),
                                               CalibrationMatrix::Zero());
  std::vector<CalibrationVector> g_calibration(problem_.pose_slots.size(),
                                               CalibrationVector::Zero());
  tbb::parallel_for(std::size_t{0}, problem_.pose_slots.size(), [&](std::size_t k) {
    LineariseKeyframe(state, k, H_calibration[k], g_calibration[k]);
  });
  tbb::parallel_for(std::size_t{0}, problem_.markers.size(),
                    [&](std::size_t slot) { AddCornersOfMarker(slot); });
  if (problem_.options.calibrate) {
    for (std::size_t k = 0; k < problem_.pose_slots.size(); ++k) {
      H_.bottomRightCorner<kCalibrationSize, kCalibrationSize>() += H_calibration[k];
      g_.tail<kCalibrationSize>() += g_calibration[k];
    }
    const CalibrationMatrix& prior = problem_.options.prior.information;
    H_.bottomRightCorner<kCalibrationSize, kCalibrationSize>() += prior;
    g_.tail<kCalibrationSize>() +=
        prior * (ToVector(state.calibration) - problem_.options.prior.mean);
  }
  const std::vector<QuadraticTerm>& terms = problem_.terms;
  std::vector<QuadraticTerm::Vector> slopes(terms.size());
  tbb::parallel_for(std::size_t{0}, terms.size(), [&](std::size_t i) {
    slopes[i] = terms[i].Slope(problem_.TermState(state, terms[i]));
  });
  for (std::size_t i = 0; i < terms.size(); ++i) AddTerm(terms[i], slopes[i]);
}

void Equations::LineariseKeyframe(const State& state, std::size_t k,
                                  CalibrationMatrix& H_calibration,
                                  CalibrationVector& g_calibration) {
  const std::optional<Eigen::Index> at = problem_.CameraAt(static_cast<int>(k));
  const bool calibrate = problem_.options.calibrate;
  CameraMatrix H = CameraMatrix::Zero();
  CameraVector g = CameraVector::Zero();
  CalibrationCamera H_coupled = CalibrationCamera::Zero();
  const Problem::Indices& views = problem_.keypoints_of_keyframe[k];
  // The depth rows side by side, so that their products are single ones.
  const auto num_rows = static_cast<Eigen::Index>(calibrate ? views.size() : 0);
  Eigen::Matrix<double, CalibrationModel::kDepthSize, Eigen::Dynamic> J_depth(
      CalibrationModel::kDepthSize, num_rows);
  Eigen::Matrix<double, kCamera, Eigen::Dynamic> J_camera(kCamera, num_rows);
  Eigen::Index row = 0;
  for (const std::uint32_t i : views) {
    rows_[i] = problem_.Linearise(state, problem_.keypoints[i]);
    const KeypointTerm::Rows& rows = rows_[i];
    if (at) {
      H.noalias() += rows.J_camera.transpose() * rows.J_camera;
      g.noalias() += rows.J_camera.transpose() * rows.r;
    }
    if (!calibrate) continue;
    J_depth.col(row) = rows.J_depth.transpose();
    J_camera.col(row++) = rows.J_camera.row(2).transpose();
    if (at)
      H_coupled.topRows<kLensAndReadout>().noalias() +=
          rows.J_lens.transpose() * rows.J_camera.topRows<2>();
    H_calibration.topLeftCorner<kLensAndReadout, kLensAndReadout>().noalias() +=
        rows.J_lens.transpose() * rows.J_lens;
    g_calibration += rows.CalibrationTimes<1>(rows.r);
  }
  if (calibrate) {
    H_calibration.bottomRightCorner<CalibrationModel::kDepthSize, CalibrationModel::kDepthSize>()
        .selfadjointView<Eigen::Lower>()
        .rankUpdate(J_depth);
    if (at)
      H_coupled.bottomRows<CalibrationModel::kDepthSize>().noalias() +=
          J_depth * J_camera.transpose();
  }
  if (at) {
    H_.block<kCamera, kCamera>(*at, *at) += H;
    g_.segment<kCamera>(*at) += g;
    if (calibrate) H_.block<kCalibrationSize, kCamera>(problem_.calibration_at, *at) += H_coupled;
  }
  for (const std::uint32_t i : problem_.corners_of_keyframe[k])
    corner_rows_[i] = problem_.Linearise(state, problem_.corners[i]);
  AddCornersOfKeyframe(k, H_calibration, g_calibration);
}

void Equations::AddCornersOfKeyframe(std::size_t k, CalibrationMatrix& H_calibration,
                                     CalibrationVector& g_calibration) {
  const std::optional<Eigen::Index> a = problem_.CameraAt(static_cast<int>(k));
  for (const std::uint32_t i : problem_.corners_of_keyframe[k]) {
    const CornerTerm::Rows& rows = corner_rows_[i];
    if (a) {
      const Eigen::Index m = problem_.MarkerAt(problem_.corners[i].marker);
      H_.block<kCamera, kCamera>(*a, *a).noalias() += rows.J_camera.transpose() * rows.J_camera;
      H_.block<6, kCamera>(m, *a).noalias() += rows.J_marker.transpose() * rows.J_camera;
      g_.segment<kCamera>(*a).noalias() += rows.J_camera.transpose() * rows.r;
    }
    if (!problem_.options.calibrate) continue;
    H_calibration.topLeftCorner<kSeenByCorners, kSeenByCorners>().noalias() +=
        rows.J_calibration.transpose() * rows.J_calibration;
    g_calibration.head<kSeenByCorners>().noalias() += rows.J_calibration.transpose() * rows.r;
    if (a)
      H_.block<kSeenByCorners, kCamera>(problem_.calibration_at, *a).noalias() +=
          rows.J_calibration.transpose() * rows.J_camera;
  }
}

void Equations::AddCornersOfMarker(std::size_t slot) {
  const Eigen::Index m = problem_.MarkerAt(static_cast<int>(slot));
  for (const std::uint32_t i : problem_.corners_of_marker[slot]) {
    const CornerTerm::Rows& rows = corner_rows_[i];
    H_.block<6, 6>(m, m).noalias() += rows.J_marker.transpose() * rows.J_marker;
    g_.segment<6>(m).noalias() += rows.J_marker.transpose() * rows.r;
    if (problem_.options.calibrate)
      H_.block<kSeenByCorners, 6>(problem_.calibration_at, m).noalias() +=
          rows.J_calibration.transpose() * rows.J_marker;
  }
}

void Equations::AddTerm(const QuadraticTerm& term, const QuadraticTerm::Vector& slope) {
  constexpr int kA = QuadraticTerm::kTwistA, kB = QuadraticTerm::kTwistB;
  constexpr int kFocal = QuadraticTerm::kFocal;
  constexpr int kFocalAt = QuadraticTerm::kFocalAt;
  constexpr int kDepthSize = CalibrationModel::kDepthSize;
  constexpr int kDepth = QuadraticTerm::kDepthCalibrationAt;
  const std::optional<Eigen::Index> a = problem_.CameraAt(term.keyframe_a);
  const std::optional<Eigen::Index> b =
      term.keyframe_b ? problem_.CameraAt(*term.keyframe_b)
                      : problem_.MarkerAt(problem_.markers.at(term.marker.value()));
  const Eigen::Index f = problem_.calibration_at + kLensAt;
  const Eigen::Index d = problem_.calibration_at + kDepthAt;
  const auto add_pose = [&](Eigen::Index at, Eigen::Index in_term) {
    H_.block<6, 6>(at, at) += term.H.block<6, 6>(in_term, in_term);
    g_.segment<6>(at) += slope.segment<6>(in_term);
    if (!problem_.options.calibrate) return;
    H_.block<kFocal, 6>(f, at) += term.H.block<kFocal, 6>(kFocalAt, in_term);
    H_.block<kDepthSize, 6>(d, at) += term.H.block<kDepthSize, 6>(kDepth, in_term);
  };
  if (a) add_pose(*a, kA);
  if (b) add_pose(*b, kB);
  if (a && b) {
    if (*b > *a) {
      H_.block<6, 6>(*b, *a) += term.H.block<6, 6>(kB, kA);
    } else {
      H_.block<6, 6>(*a, *b) += term.H.block<6, 6>(kA, kB);
    }
  }
  if (!problem_.options.calibrate) return;
  H_.block<kFocal, kFocal>(f, f) += term.H.block<kFocal, kFocal>(kFocalAt, kFocalAt);
  H_.block<kDepthSize, kFocal>(d, f) += term.H.block<kDepthSize, kFocal>(kDepth, kFocalAt);
  H_.block<kDepthSize, kDepthSize>(d, d) += term.H.bottomRightCorner<kDepthSize, kDepthSize>();
  g_.segment<kFocal>(f) += slope.segment<kFocal>(kFocalAt);
  g_.segment<kDepthSize>(d) += slope.tail<kDepthSize>();
}

}  // namespace plumb::bundle
