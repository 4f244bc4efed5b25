// SPDX-License-Identifier: Apache-2.0
#include "algo/bundle/bundle_adjustment.hpp"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>
#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>

#include "algo/base/check_stop.hpp"
#include "algo/bundle/bundle_equations.hpp"

namespace plumb {
namespace {

using namespace bundle;  // NOLINT: the model's names are this file's vocabulary
using CalibrationPoint = Eigen::Matrix<double, kCalibrationSize, 3>;

// Number of unknowns above which a sparse factorisation is faster.
constexpr Eigen::Index kLargestDenseSystem = 1200;
// With this damping steps are so short that, if they do not reduce the cost, the minimum is
// reached.
constexpr double kLargestDamping = 1e3;

// A landmark's own 3x3 system, inverted, and its coupling to the free keyframes and the
// calibration.
struct PointSystem {
  Eigen::Matrix3d V_inverse;
  Eigen::Vector3d g;
  std::vector<std::pair<int, CameraPoint>> W;  // Camera slots, ascending.
  CalibrationPoint W_calibration;
};

// Levenberg-Marquardt on one problem.
class Solver {
 public:
  explicit Solver(const Problem& problem)
      : problem_(problem),
        options_(problem.options),
        equations_(problem),
        points_(problem.landmarks.size()) {}

  BundleSummary Run();

 private:
  void MakePoint(std::size_t s, double damping);
  // One damped Gauss-Newton step; false if the system cannot be solved.
  bool Step(const State& state, double damping, State& next);
  // Takes the longest step that reduces the cost, from the present equations; false if there is
  // none. A step that is too long is no iteration: the rounds of the joint solve have few.
  bool Improve(State& state, double& cost, double& damping, int& num_shortened);
  // Information about the calibration once everything else has been eliminated, and the posterior.
  void FindInformation(const State& state, BundleSummary& summary);
  [[nodiscard]] BundlePosterior Posterior(Eigen::MatrixXd S) const;
  // Columns of the unit matrix for the calibration, zero for what the options fix.
  [[nodiscard]] Eigen::MatrixXd FreeCalibration() const;
  // Keeps in place what the options fix.
  void PinFixed(Eigen::MatrixXd& S, Eigen::VectorXd& right) const;
  // S -= W V^-1 W', right -= W V^-1 g over all landmarks. The rows of each free keyframe are one
  // task, so every block has exactly one writer.
  void Eliminate(Eigen::MatrixXd& S, Eigen::VectorXd& right) const;

  const Problem& problem_;
  const BundleOptions& options_;
  Equations equations_;
  std::vector<PointSystem> points_;
};

// Fixes `count` unknowns at their present values.
void Pin(Eigen::Index first, Eigen::Index count, Eigen::MatrixXd& S, Eigen::VectorXd& right) {
  S.middleRows(first, count).setZero();
  S.middleCols(first, count).setZero();
  S.diagonal().segment(first, count).setOnes();
  right.segment(first, count).setZero();
}

// Column by column, without another dense matrix.
Eigen::SparseMatrix<double> LowerHalf(const Eigen::MatrixXd& S) {
  Eigen::VectorXi counts(S.cols());
  for (Eigen::Index c = 0; c < S.cols(); ++c)
    counts[c] = static_cast<int>((S.col(c).tail(S.rows() - c).array() != 0.0).count());
  Eigen::SparseMatrix<double> sparse(S.rows(), S.cols());
  sparse.reserve(counts);
  for (Eigen::Index c = 0; c < S.cols(); ++c)
    for (Eigen::Index r = c; r < S.rows(); ++r)
      if (S(r, c) != 0.0) sparse.insert(r, c) = S(r, c);
  sparse.makeCompressed();
  return sparse;
}

bool Solve(const Eigen::MatrixXd& S, const Eigen::VectorXd& right, Eigen::VectorXd& x) {
  if (S.rows() <= kLargestDenseSystem) {
    const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> solver(S);
    if (solver.info() != Eigen::Success) return false;
    x = solver.solve(right);
  } else {
    const Eigen::SparseMatrix<double> sparse = LowerHalf(S);
    const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower> solver(sparse);
    if (solver.info() != Eigen::Success) return false;
    x = solver.solve(right);
  }
  return x.allFinite();
}

BundleSummary Solver::Run() {
  BundleSummary summary;
  State state = problem_.Start();
  double cost = problem_.Cost(state);
  summary.initial_cost = summary.final_cost = cost;
  if (!std::isfinite(cost) || problem_.size == 0) return summary;
  double damping = options_.initial_damping;
  while (summary.num_iterations < options_.max_iterations) {
    CheckStop(options_.stop);
    ++summary.num_iterations;
    equations_.Linearise(state);
    const double before = cost;
    if (!Improve(state, cost, damping, summary.num_shortened)) break;
    damping = std::max(1e-9, 0.2 * damping);
    if (before - cost < options_.function_tolerance * std::abs(before)) break;
  }
  summary.final_cost = cost;
  if (options_.find_information) FindInformation(state, summary);
  problem_.Write(state);
  return summary;
}

bool Solver::Improve(State& state, double& cost, double& damping, int& num_shortened) {
  for (; damping < kLargestDamping; damping *= 10.0, ++num_shortened) {
    CheckStop(options_.stop);
    State next;
    if (!Step(state, damping, next)) continue;
    const double next_cost = problem_.Cost(next);
    if (!(next_cost < cost)) continue;
    state = std::move(next);
    cost = next_cost;
    return true;
  }
  return false;
}

void Solver::MakePoint(std::size_t s, double damping) {
  PointSystem& point = points_[s];
  Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
  point.g.setZero();
  point.W.clear();
  point.W_calibration.setZero();
  for (const std::uint32_t i : problem_.keypoints_of_landmark[s]) {
    const KeypointTerm::Rows& view = equations_.rows()[i];
    V.noalias() += view.J_point.transpose() * view.J_point;
    point.g.noalias() += view.J_point.transpose() * view.r;
    if (const std::optional<int> slot = problem_.PoseSlot(problem_.keypoints[i].keyframe))
      point.W.emplace_back(*slot, view.J_camera.transpose() * view.J_point);
    if (options_.calibrate) point.W_calibration += view.CalibrationTimes<3>(view.J_point);
  }
  V.diagonal() *= 1.0 + damping;
  V.diagonal().array() += 1e-9 * V.trace() + 1e-12;
  point.V_inverse = V.inverse();
}

bool Solver::Step(const State& state, double damping, State& next) {
  tbb::parallel_for(std::size_t{0}, points_.size(), [&](std::size_t s) { MakePoint(s, damping); });
  Eigen::MatrixXd S = equations_.H();
  S.diagonal() *= 1.0 + damping;
  S.diagonal().array() += 1e-9;
  Eigen::VectorXd right = equations_.g();
  Eliminate(S, right);
  PinFixed(S, right);
  Eigen::VectorXd x;
  if (!Solve(S, right, x)) return false;
  next = state;
  for (std::size_t slot = 0; slot < problem_.free.size(); ++slot) {
    CameraState& camera = next.cameras[static_cast<std::size_t>(problem_.free[slot])];
    camera.twist -= x.segment<6>(kCamera * static_cast<Eigen::Index>(slot));
    camera.Prepare();
  }
  for (std::size_t m = 0; m < problem_.markers.size(); ++m)
    next.markers[m] -= x.segment<6>(problem_.MarkerAt(static_cast<int>(m)));
  if (options_.calibrate) MoveCalibration(-x.tail<kCalibrationSize>(), next.calibration);
  tbb::parallel_for(std::size_t{0}, points_.size(), [&](std::size_t s) {
    const PointSystem& point = points_[s];
    Eigen::Vector3d rest = point.g;
    for (const auto& [a, W] : point.W)
      rest.noalias() -= W.transpose() * x.segment<kCamera>(kCamera * static_cast<Eigen::Index>(a));
    if (options_.calibrate)
      rest.noalias() -= point.W_calibration.transpose() * x.tail<kCalibrationSize>();
    next.landmarks[s] -= point.V_inverse * rest;
  });
  return true;
}

void Solver::PinFixed(Eigen::MatrixXd& S, Eigen::VectorXd& right) const {
  if (options_.calibrate && options_.fix_centre_and_distortion)
    Pin(problem_.calibration_at + kLensAt + QuadraticTerm::kFocal,
        CalibrationModel::kLensSize - QuadraticTerm::kFocal, S, right);
  if (options_.calibrate && options_.fix_depth_field)
    Pin(problem_.calibration_at + kDepthAt + kDepthField, kNumDepthTerms - kDepthField, S, right);
}

void Solver::FindInformation(const State& state, BundleSummary& summary) {
  equations_.Linearise(state);
  tbb::parallel_for(std::size_t{0}, points_.size(), [&](std::size_t s) { MakePoint(s, 0.0); });
  Eigen::MatrixXd S = equations_.H();
  S.diagonal().array() += 1e-9;
  Eigen::VectorXd right = equations_.g();
  Eliminate(S, right);
  summary.posterior = Posterior(S);
  if (!options_.calibrate) return;
  const Eigen::MatrixXd poses = S.topLeftCorner(problem_.calibration_at, problem_.calibration_at);
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> solver(poses);
  if (solver.info() != Eigen::Success) return;
  const Eigen::MatrixXd coupling = S.bottomLeftCorner(kCalibrationSize, problem_.calibration_at);
  CalibrationMatrix information =
      S.bottomRightCorner<kCalibrationSize, kCalibrationSize>().selfadjointView<Eigen::Lower>();
  information -= coupling * solver.solve(coupling.transpose());
  information -= options_.prior.information;
  summary.information = 0.5 * (information + information.transpose());
}

BundlePosterior Solver::Posterior(Eigen::MatrixXd S) const {
  BundlePosterior posterior;
  Eigen::VectorXd right = Eigen::VectorXd::Zero(S.rows());
  PinFixed(S, right);
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> solver(S);
  if (solver.info() != Eigen::Success) return posterior;
  const auto num_markers = static_cast<Eigen::Index>(problem_.markers.size());
  if (num_markers > 0) {
    const Eigen::Index first = problem_.MarkerAt(0);
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(S.rows(), 6 * num_markers);
    unit.middleRows(first, 6 * num_markers).setIdentity();
    posterior.of_markers = solver.solve(unit).middleRows(first, 6 * num_markers);
    if (!posterior.of_markers.allFinite()) return {};
  }
  if (options_.calibrate) {
    posterior.with_calibration = solver.solve(FreeCalibration());
    if (!posterior.with_calibration.allFinite()) return {};
  }
  for (std::size_t k = 0; k < problem_.pose_slots.size(); ++k)
    posterior.camera_rows.push_back(problem_.CameraAt(static_cast<int>(k)));
  for (const auto& [id, slot] : problem_.markers)
    posterior.marker_rows[id] = problem_.MarkerAt(slot);
  return posterior;
}

Eigen::MatrixXd Solver::FreeCalibration() const {
  Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(problem_.size, kCalibrationSize);
  unit.bottomRows<kCalibrationSize>().setIdentity();
  if (options_.fix_centre_and_distortion)
    unit.block(problem_.calibration_at + kLensAt + QuadraticTerm::kFocal,
               kLensAt + QuadraticTerm::kFocal, CalibrationModel::kLensSize - QuadraticTerm::kFocal,
               CalibrationModel::kLensSize - QuadraticTerm::kFocal)
        .setZero();
  if (options_.fix_depth_field)
    unit.bottomRightCorner<kNumDepthTerms - kDepthField, kNumDepthTerms - kDepthField>().setZero();
  return unit;
}

void Solver::Eliminate(Eigen::MatrixXd& S, Eigen::VectorXd& right) const {
  tbb::parallel_for(std::size_t{0}, problem_.free.size(), [&](std::size_t slot) {
    const auto a = kCamera * static_cast<Eigen::Index>(slot);
    const Problem::Indices& views =
        problem_.keypoints_of_keyframe[static_cast<std::size_t>(problem_.free[slot])];
    // Side by side, so that the product with the calibration is one.
    const auto num_columns = static_cast<Eigen::Index>(options_.calibrate ? 3 * views.size() : 0);
    Eigen::Matrix<double, kCalibrationSize, Eigen::Dynamic> all_W(kCalibrationSize, num_columns);
    Eigen::Matrix<double, kCamera, Eigen::Dynamic> all_WV(kCamera, num_columns);
    Eigen::Index column = 0;
    for (const std::uint32_t i : views) {
      const PointSystem& point = points_[static_cast<std::size_t>(problem_.keypoints[i].landmark)];
      const CameraPoint WV = equations_.rows()[i].J_camera.transpose() *
                             (equations_.rows()[i].J_point * point.V_inverse);
      right.segment<kCamera>(a).noalias() -= WV * point.g;
      for (const auto& [b, W] : point.W)
        if (b <= static_cast<int>(slot))
          S.block<kCamera, kCamera>(a, kCamera * static_cast<Eigen::Index>(b)).noalias() -=
              WV * W.transpose();
      if (!options_.calibrate) continue;
      all_W.middleCols<3>(column) = point.W_calibration;
      all_WV.middleCols<3>(column) = WV;
      column += 3;
    }
    if (options_.calibrate)
      S.block<kCalibrationSize, kCamera>(problem_.calibration_at, a).noalias() -=
          all_W * all_WV.transpose();
  });
  if (!options_.calibrate) return;
  // Lower half: V^-1 = L L', so W V^-1 W' is the square of the columns W L.
  constexpr std::size_t kAtOnce = 64;
  const std::size_t num_blocks = (points_.size() + kAtOnce - 1) / kAtOnce;
  std::vector<CalibrationMatrix> H(num_blocks, CalibrationMatrix::Zero());
  std::vector<CalibrationVector> g(num_blocks, CalibrationVector::Zero());
  tbb::parallel_for(std::size_t{0}, num_blocks, [&](std::size_t block) {
    const std::size_t first = block * kAtOnce;
    const std::size_t count = std::min(kAtOnce, points_.size() - first);
    Eigen::Matrix<double, kCalibrationSize, Eigen::Dynamic> columns(kCalibrationSize, 3 * count);
    for (std::size_t i = 0; i < count; ++i) {
      const PointSystem& point = points_[first + i];
      columns.middleCols<3>(static_cast<Eigen::Index>(3 * i)).noalias() =
          point.W_calibration * point.V_inverse.llt().matrixL();
      g[block].noalias() += point.W_calibration * (point.V_inverse * point.g);
    }
    H[block].selfadjointView<Eigen::Lower>().rankUpdate(columns);
  });
  for (std::size_t block = 0; block < num_blocks; ++block) {
    S.bottomRightCorner<kCalibrationSize, kCalibrationSize>() -= H[block];
    right.tail<kCalibrationSize>() -= g[block];
  }
}

}  // namespace

BundleSummary BundleAdjust(const Intrinsics& stated, const BundleOptions& options,
                           const std::vector<QuadraticTerm>& terms, TrackingMap& map,
                           CalibrationModel& calibration) {
  const Problem problem(stated, options, terms, map, calibration);
  return Solver(problem).Run();
}

}  // namespace plumb
