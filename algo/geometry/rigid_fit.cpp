// SPDX-License-Identifier: Apache-2.0
#include "algo/geometry/rigid_fit.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/SVD>

namespace plumb {
namespace {

// A spread below this fraction of the largest spread counts as zero. Singular values of a scatter
// are squared lengths, so 1e-9 requires a set about 30 000 times longer than wide, far beyond any
// measured line of points.
constexpr double kRelativeRankTolerance = 1e-9;

struct WeightedMean {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double total = 0.0;
};

WeightedMean MeanOf(std::span<const Eigen::Vector3d> points, std::span<const double> weights) {
  WeightedMean result;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double w = weights.empty() ? 1.0 : weights[i];
    result.mean += w * points[i];
    result.total += w;
  }
  if (result.total > 0) result.mean /= result.total;
  return result;
}

// Rank of a centred scatter. `scale` is the squared distance from the origin, which bounds the
// rounding error.
int ScatterRank(const Eigen::Matrix3d& scatter, double scale) {
  const Eigen::Vector3d spread = scatter.jacobiSvd().singularValues();
  const double floor = std::max(spread[0] * kRelativeRankTolerance, scale * 1e-14);
  int rank = 0;
  for (int i = 0; i < 3; ++i) rank += spread[i] > floor ? 1 : 0;
  return rank;
}

void CheckArguments(std::span<const Eigen::Vector3d> points_a,
                    std::span<const Eigen::Vector3d> points_b, std::span<const double> weights) {
  if (points_a.size() != points_b.size()) {
    throw std::invalid_argument(fmt::format("FitRigid needs paired points, got {} in a and {} in b",
                                            points_a.size(), points_b.size()));
  }
  if (!weights.empty() && weights.size() != points_a.size()) {
    throw std::invalid_argument(fmt::format(
        "FitRigid needs one weight for each of {} pairs, got {}", points_a.size(), weights.size()));
  }
  for (const double w : weights) {
    if (!(w >= 0) || !std::isfinite(w))
      throw std::invalid_argument("FitRigid: weights must be finite and >= 0");
  }
}

}  // namespace

RigidFit FitRigid(std::span<const Eigen::Vector3d> points_a,
                  std::span<const Eigen::Vector3d> points_b, std::span<const double> weights) {
  CheckArguments(points_a, points_b, weights);
  RigidFit fit;
  const WeightedMean a = MeanOf(points_a, weights);
  const WeightedMean b = MeanOf(points_b, weights);
  if (!(a.total > 0) || !a.mean.allFinite() || !b.mean.allFinite()) return fit;

  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d scatter_a = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d scatter_b = Eigen::Matrix3d::Zero();
  int num_weighted = 0;
  for (std::size_t i = 0; i < points_a.size(); ++i) {
    const double w = weights.empty() ? 1.0 : weights[i];
    const Eigen::Vector3d da = points_a[i] - a.mean;
    const Eigen::Vector3d db = points_b[i] - b.mean;
    cross += w * da * db.transpose();
    scatter_a += w * da * da.transpose();
    scatter_b += w * db * db.transpose();
    num_weighted += w > 0 ? 1 : 0;
  }
  if (!cross.allFinite() || !scatter_a.allFinite() || !scatter_b.allFinite()) return fit;
  fit.rank = std::min(ScatterRank(scatter_a, a.total * a.mean.squaredNorm()),
                      ScatterRank(scatter_b, b.total * b.mean.squaredNorm()));

  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // Two sets of rank 2 can still form a cross scatter of rank 1 (wrong correspondences), which
  // leaves a rotation undetermined.
  const Eigen::Vector3d shared = svd.singularValues();
  const bool determined = shared[1] > std::max(shared[0] * kRelativeRankTolerance, 0.0);
  if (num_weighted < 3 || fit.rank < 2 || !determined) return fit;

  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1.0 : 1.0;
  fit.T_a_b.linear() =
      svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  fit.T_a_b.translation() = a.mean - fit.T_a_b.linear() * b.mean;
  double sum = 0.0;
  for (std::size_t i = 0; i < points_a.size(); ++i) {
    const double w = weights.empty() ? 1.0 : weights[i];
    sum += w * (points_a[i] - fit.T_a_b * points_b[i]).squaredNorm();
  }
  fit.rms_m = std::sqrt(sum / a.total);
  fit.valid = true;
  return fit;
}

}  // namespace plumb
