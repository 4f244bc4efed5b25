// SPDX-License-Identifier: Apache-2.0
// Rows of residuals of depth, and their sum in a quadratic term.
#pragma once

#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "algo/base/robust_weights.hpp"
#include "algo/registration/depth_views.hpp"

namespace plumb::dense {

// The parts of a term's two twists.
inline constexpr int kRotationA = QuadraticTerm::kTwistA, kShiftA = kRotationA + 3;
inline constexpr int kRotationB = QuadraticTerm::kTwistB, kShiftB = kRotationB + 3;

/// Standard deviation of what the depth's noise model leaves out.
inline constexpr double kUnmodelled_m = 0.001;

/// One linearised residual of depth, without weight. It has a Cauchy loss at two standard
/// deviations, see TermSum.
struct DepthRow {
  double residual_m = 0;
  double sigma_m = 0;
  QuadraticTerm::Vector J;  ///< In the unknowns of a QuadraticTerm.

  /// A residual in metres of the scene shrinks with the scene, so the solver would shrink the
  /// scene. The residual is therefore converted back to the units of the measurement, and so is J:
  /// divided by the slope of the correction, because that is what the measurement's noise is
  /// multiplied by. (The ratio of the two depths is not: the solver could then reduce the noise's
  /// share by an offset and a growth of opposite signs, and did: +28 mm and -0.015/m on a real
  /// Kinect.)
  /// @param slope  View::slopes, or what stands for those of several cells.
  /// @param J_slope  Its derivative with respect to the depth calibration.
  void ConvertToRawUnits(double slope, const DepthVector& J_slope) {
    J /= slope;
    residual_m /= slope;
    J.tail<CalibrationModel::kDepthSize>() -= residual_m / slope * J_slope;
  }
};

/// Errors of the two depth images of a pair, or of the one of a marker's face, that a term does not
/// solve for: 1/2 e' H_e e + g_e' e + e' H_ex x, beside what the term has of x.
struct ImageErrorPart {
  using Errors = Eigen::Matrix<double, 6, 1>;  ///< ImageError of a, then of b.
  Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, QuadraticTerm::kSize> H_x =
      Eigen::Matrix<double, 6, QuadraticTerm::kSize>::Zero();
  Errors g = Errors::Zero();

  /// @param J  Derivative of the residual with respect to the errors.
  void Add(const DepthRow& row, const Errors& J, double weight) {
    H += weight * J * J.transpose();
    H_x += weight * J * row.J.transpose();
    g += weight * row.residual_m * J;
  }
  /// Leaves a term as uncertain as errors with this prior make it.
  /// @param information  Of the prior, which has the mean 0.
  /// @param at  Errors at which the term was linearised.
  void RemoveFrom(QuadraticTerm& term, const Errors& information, const Errors& at) const {
    Eigen::Matrix<double, 6, 6> with_prior = H;
    with_prior.diagonal() += information;
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(with_prior);
    term.H -= H_x.transpose() * solver.solve(H_x);
    term.g -= H_x.transpose() * solver.solve(g + information.cwiseProduct(at));
  }
};

/// The same of the DepthCurve that all images share, beside H and g of the images' errors.
struct DepthCurvePart {
  static constexpr int kSize = DepthCurve::kSize;
  Eigen::Matrix<double, kSize, kSize> H = Eigen::Matrix<double, kSize, kSize>::Zero();
  Eigen::Matrix<double, kSize, 6> H_errors = Eigen::Matrix<double, kSize, 6>::Zero();
  Eigen::Matrix<double, kSize, QuadraticTerm::kSize> H_x =
      Eigen::Matrix<double, kSize, QuadraticTerm::kSize>::Zero();
  DepthCurve::Knots g = DepthCurve::Knots::Zero();

  /// @param J  Derivative of the residual with respect to the images' errors, of which the offsets
  ///           act as the curve does.
  /// @param z_a_m, z_b_m  The two cells' measured depths.
  void Add(const DepthRow& row, const ImageErrorPart::Errors& J, double z_a_m, double z_b_m,
           double weight) {
    const DepthCurve::Place a = DepthCurve::At(z_a_m), b = DepthCurve::At(z_b_m);
    const std::array<int, 4> knots = {a.knot, a.knot + 1, b.knot, b.knot + 1};
    const std::array<double, 4> along = {J[0] * (1.0 - a.share), J[0] * a.share,
                                         J[3] * (1.0 - b.share), J[3] * b.share};
    for (std::size_t i = 0; i < knots.size(); ++i) {
      for (std::size_t k = 0; k < knots.size(); ++k)
        H(knots[i], knots[k]) += weight * along[i] * along[k];
      H_errors.row(knots[i]) += weight * along[i] * J.transpose();
      H_x.row(knots[i]) += weight * along[i] * row.J.transpose();
      g[knots[i]] += weight * row.residual_m * along[i];
    }
  }
};

/// Accumulates squared residuals into a term. Rows are collected and multiplied in blocks, which is
/// several times faster than one by one. Single precision is not sufficient: the last bit of a
/// stamp would change the poses, and a recording would not reproduce the live result.
class TermSum {
 public:
  explicit TermSum(QuadraticTerm& term) : term_(term) {}
  [[nodiscard]] static double WeightOf(const DepthRow& row, double share) {
    const double in_sigmas = row.residual_m / row.sigma_m;
    return share * CauchyWeight(in_sigmas * in_sigmas, kLossScale) / (row.sigma_m * row.sigma_m);
  }
  /// @param share  Weight of the row beside its loss and its standard deviation.
  /// @return the weight of the squared residual.
  double Add(const DepthRow& row, double share) {
    const double weight = WeightOf(row, share);
    const double root = std::sqrt(weight);
    rows_.col(count_) = root * row.J;
    residuals_[count_] = root * row.residual_m;
    if (++count_ == kBlock) Flush();
    return weight;
  }
  void Finish() {
    Flush();
    term_.H.triangularView<Eigen::StrictlyUpper>() = term_.H.transpose();
  }

 private:
  static constexpr double kLossScale = 2.0;  // Cauchy scale in standard deviations.
  static constexpr int kBlock = 64;
  void Flush() {
    if (count_ == 0) return;
    term_.H.selfadjointView<Eigen::Lower>().rankUpdate(rows_.leftCols(count_));
    term_.g.noalias() += rows_.leftCols(count_) * residuals_.head(count_);
    count_ = 0;
  }
  QuadraticTerm& term_;
  int count_ = 0;
  Eigen::Matrix<double, QuadraticTerm::kSize, kBlock> rows_;
  Eigen::Matrix<double, kBlock, 1> residuals_;
};

}  // namespace plumb::dense
