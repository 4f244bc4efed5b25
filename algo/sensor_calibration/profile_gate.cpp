// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/profile_gate.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "algo/base/errors.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

constexpr double kDaysOfDrift = 30.0;
constexpr double kMaxDays = 3650.0;  // limits the effect of a clock that was never set
// A direction in which a sweep reduces the variance by a smaller fraction carries no information;
// its contribution would be a quotient of rounding errors.
constexpr double kMinInformation = 0.01;

// A covariance without the shift of marker edges.
using Reduced = Eigen::Matrix<double, kCalibrationSize - 1, kCalibrationSize - 1>;

Eigen::Index Place(Eigen::Index i) { return i < kEdgeBiasAt ? i : i + 1; }

Reduced WithoutEdges(const CalibrationMatrix& m) {
  Reduced reduced;
  for (Eigen::Index r = 0; r < reduced.rows(); ++r)
    for (Eigen::Index c = 0; c < reduced.cols(); ++c) reduced(r, c) = m(Place(r), Place(c));
  return reduced;
}

}  // namespace

SensorProfile Aged(const SensorProfile& profile, double days) {
  SensorProfile aged = profile;
  const double months = std::clamp(days, 0.0, kMaxDays) / kDaysOfDrift;
  aged.covariance.diagonal() += months * DriftBetweenSweeps().cwiseAbs2();
  return aged;
}

double ChiSquareLimit(int degrees_of_freedom) {
  if (degrees_of_freedom <= 0) return 0.0;
  constexpr double kNormal = 3.0902;  // exceeded once in a thousand
  const double n = degrees_of_freedom;
  const double root = 1.0 - 2.0 / (9.0 * n) + kNormal * std::sqrt(2.0 / (9.0 * n));
  return n * root * root * root;
}

ProfileAgreement Agreement(const SensorProfile& before, const SensorProfile& after) {
  // The prior of the sweep's solution: see PriorOfNextSweep().
  CalibrationMatrix prior = before.covariance;
  prior.diagonal() += DriftBetweenSweeps().cwiseAbs2();
  const Eigen::LLT<Reduced> root(WithoutEdges(prior));
  if (root.info() != Eigen::Success) throw DataError(say::sensor::ProfileCovarianceReset());
  Eigen::Matrix<double, kCalibrationSize - 1, 1> moved;
  for (Eigen::Index i = 0; i < moved.size(); ++i)
    moved[i] = after.mean[Place(i)] - before.mean[Place(i)];
  root.matrixL().solveInPlace(moved);
  Reduced left = WithoutEdges(after.covariance);
  root.matrixL().solveInPlace(left);
  left.transposeInPlace();
  root.matrixL().solveInPlace(left);
  const Eigen::SelfAdjointEigenSolver<Reduced> eigen(0.5 * (left + left.transpose()));
  ProfileAgreement agreement;
  for (Eigen::Index i = 0; i < moved.size(); ++i) {
    const double information = 1.0 - eigen.eigenvalues()[i];
    if (information < kMinInformation) continue;
    const double along = eigen.eigenvectors().col(i).dot(moved);
    agreement.chi_square += along * along / information;
    ++agreement.num_terms;
  }
  agreement.limit = ChiSquareLimit(agreement.num_terms);
  return agreement;
}

}  // namespace plumb
