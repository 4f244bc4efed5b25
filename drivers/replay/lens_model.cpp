// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/lens_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/QR>

namespace plumb {
namespace {

constexpr double kMostAngle_rad = 75.0 * 3.14159265358979323846 / 180.0;
// Markers' corners are found to 0.05 px at best.
constexpr double kMostDifference_px = 0.05;
constexpr int kSamples = 400;
constexpr int kRounds = 8;

double EquidistantRadius(const std::array<double, 4>& k, double theta) {
  const double t2 = theta * theta;
  return theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

/// The angle whose distorted radius is this one; nothing if none up to the largest angle has it, or
/// the radius does not grow all the way.
std::optional<double> AngleOf(const std::array<double, 4>& k, double radius) {
  constexpr int kSteps = 7500;  // 0.01 deg
  double before = 0.0;
  for (int i = 1; i <= kSteps; ++i) {
    const double theta = kMostAngle_rad * i / kSteps;
    const double now = EquidistantRadius(k, theta);
    if (!(now > before)) return std::nullopt;
    if (now >= radius) return theta;
    before = now;
  }
  return std::nullopt;
}

struct LensSamples {
  Eigen::VectorXd radius{kSamples};  ///< Of the ideal ray, x² + y² under a root.
  Eigen::VectorXd factor{kSamples};  ///< The lens's radial factor there.
  double scale = 1.0;                ///< The largest radius squared.
};

/// The largest difference on the image, for a focal length of 1; infinite behind a pole.
double ErrorOf(const std::array<double, 8>& lens, const LensSamples& samples) {
  double worst = 0.0;
  for (int i = 0; i < kSamples; ++i) {
    const double r = samples.radius[i];
    const RadialFactor fitted = RadialFactorAt(lens, r * r);
    if (!(fitted.denominator > 0)) return std::numeric_limits<double>::infinity();
    worst = std::max(worst, std::abs(fitted.value - samples.factor[i]) * r);
  }
  return worst;
}

/// N(r2) = f D(r2) is linear in the coefficients. Divided by the last round's D and times r, its
/// residual is that of the image (Sanathanan and Koerner 1963). r2 is scaled to 1, for the
/// conditioning. The best of the rounds is kept.
/// @param terms  Of the denominator.
void Fit(const LensSamples& samples, int terms, std::array<double, 8>& best, double& best_error) {
  Eigen::MatrixXd rows(kSamples, 3 + terms);
  for (int i = 0; i < kSamples; ++i) {
    const double u = samples.radius[i] * samples.radius[i] / samples.scale;
    const Eigen::RowVector3d powers(u, u * u, u * u * u);
    rows.row(i) << powers, -samples.factor[i] * powers.head(terms);
  }
  Eigen::VectorXd weight = samples.radius;
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::VectorXd c =
        (weight.asDiagonal() * rows)
            .eval()
            .colPivHouseholderQr()
            .solve(weight.cwiseProduct(samples.factor - Eigen::VectorXd::Ones(kSamples)));
    std::array<double, 6> unscaled{};
    double power = 1.0;
    for (int i = 0; i < 3; ++i) {
      power *= samples.scale;
      unscaled[static_cast<std::size_t>(i)] = c[i] / power;
      if (i < terms) unscaled[static_cast<std::size_t>(3 + i)] = c[3 + i] / power;
    }
    const auto [k1, k2, k3, k4, k5, k6] = unscaled;
    const std::array<double, 8> lens = {k1, k2, 0, 0, k3, k4, k5, k6};
    if (const double error = ErrorOf(lens, samples); error < best_error) {
      best_error = error;
      best = lens;
    }
    for (int i = 0; i < kSamples; ++i) {
      const double r = samples.radius[i];
      weight[i] = r / std::abs(RadialFactorAt(lens, r * r).denominator);
    }
  }
}

}  // namespace

std::optional<std::array<double, 8>> RationalOfEquidistant(const std::array<double, 4>& k,
                                                           const Intrinsics& camera) {
  const double x = std::max(camera.cx, camera.width - 1 - camera.cx) / camera.fx;
  const double y = std::max(camera.cy, camera.height - 1 - camera.cy) / camera.fy;
  const std::optional<double> widest = AngleOf(k, std::hypot(x, y));
  if (!widest) return std::nullopt;
  LensSamples samples;
  const double end = std::tan(*widest);
  samples.scale = end * end;
  for (int i = 0; i < kSamples; ++i) {
    const double r = end * (i + 1) / kSamples;
    samples.radius[i] = r;
    samples.factor[i] = EquidistantRadius(k, std::atan(r)) / r;
  }
  std::array<double, 8> best{};
  double best_error = std::numeric_limits<double>::infinity();
  // With all three terms of the denominator, a pole and a zero may meet within the image.
  for (const int terms : {3, 2, 1}) Fit(samples, terms, best, best_error);
  // The negation also catches what is no number.
  if (!(best_error * std::max(camera.fx, camera.fy) <= kMostDifference_px)) return std::nullopt;
  return best;
}

}  // namespace plumb
