// SPDX-License-Identifier: Apache-2.0
#include "algo/base/intrinsics.hpp"

#include <algorithm>

namespace plumb {
namespace {

constexpr std::size_t kPlain = 5;  // Coefficients of OpenCV's plain model.

}  // namespace

std::span<const double> LensCoefficients(const Intrinsics& intrinsics) {
  const std::span<const double> all = intrinsics.distortion;
  const bool is_plain = std::ranges::all_of(all.subspan(kPlain), [](double k) { return k == 0; });
  return is_plain ? all.first(kPlain) : all;
}

bool SetLensCoefficients(std::span<const double> coefficients, Intrinsics& intrinsics) {
  if (coefficients.size() != kPlain && coefficients.size() != intrinsics.distortion.size())
    return false;
  intrinsics.distortion = {};
  std::ranges::copy(coefficients, intrinsics.distortion.begin());
  return true;
}

bool HasLens(const Intrinsics& intrinsics) {
  return intrinsics.distortion != std::array<double, 8>{};
}

RadialFactor RadialFactorAt(const std::array<double, 8>& distortion, double r2) {
  const auto& [k1, k2, p1, p2, k3, k4, k5, k6] = distortion;
  const double numerator = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double denominator = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
  const double value = numerator / denominator;
  const double slope =
      (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3) - value * (k4 + r2 * (2.0 * k5 + 3.0 * r2 * k6))) /
      denominator;
  return {.value = value, .slope = slope, .denominator = denominator};
}

Eigen::Vector2d DistortNormalised(const Intrinsics& intrinsics, const Eigen::Vector2d& ideal) {
  const double p1 = intrinsics.distortion[2];
  const double p2 = intrinsics.distortion[3];
  const double x = ideal.x();
  const double y = ideal.y();
  const double r2 = x * x + y * y;
  const double radial = RadialFactorAt(intrinsics.distortion, r2).value;
  return {x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
          y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y};
}

Eigen::Vector2d Project(const Intrinsics& intrinsics, const Eigen::Vector3d& p_camera) {
  const Eigen::Vector2d d = DistortNormalised(intrinsics, p_camera.head<2>() / p_camera.z());
  return {intrinsics.fx * d.x() + intrinsics.cx, intrinsics.fy * d.y() + intrinsics.cy};
}

Eigen::Vector2d Undistort(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d distorted((pixel.x() - intrinsics.cx) / intrinsics.fx,
                                  (pixel.y() - intrinsics.cy) / intrinsics.fy);
  if (!HasLens(intrinsics)) return distorted;
  const int rounds = LensCoefficients(intrinsics).size() == kPlain ? 20 : 200;
  const double p1 = intrinsics.distortion[2];
  const double p2 = intrinsics.distortion[3];
  Eigen::Vector2d ideal = distorted;
  for (int i = 0; i < rounds; ++i) {
    const double x = ideal.x();
    const double y = ideal.y();
    const double r2 = x * x + y * y;
    const double radial = RadialFactorAt(intrinsics.distortion, r2).value;
    const Eigen::Vector2d tangential(2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                                     p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
    const Eigen::Vector2d next = (distorted - tangential) / radial;
    if (next == ideal) break;  // Further iterations would give identical bits.
    ideal = next;
  }
  return ideal;
}

Intrinsics Resized(const Intrinsics& intrinsics, int width, int height) {
  const double sx = static_cast<double>(width) / intrinsics.width;
  const double sy = static_cast<double>(height) / intrinsics.height;
  Intrinsics resized = intrinsics;
  resized.width = width;
  resized.height = height;
  resized.fx *= sx;
  resized.fy *= sy;
  resized.cx = (intrinsics.cx + 0.5) * sx - 0.5;
  resized.cy = (intrinsics.cy + 0.5) * sy - 0.5;
  return resized;
}

}  // namespace plumb
