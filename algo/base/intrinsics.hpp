// SPDX-License-Identifier: Apache-2.0
// The pinhole camera with OpenCV's rational lens model.
#pragma once

#include <array>
#include <span>

#include <Eigen/Core>

namespace plumb {

/// Intrinsics of one camera. Pixel centres lie at integer coordinates (OpenCV's convention).
/// Registered depth lies on the same (distorted) pixel grid as the colour image.
struct Intrinsics {
  int width = 640;   ///< Pixels.
  int height = 480;  ///< Pixels.
  double fx = 525.0;
  double fy = 525.0;
  double cx = 319.5;
  double cy = 239.5;
  /// k1 k2 p1 p2 k3 k4 k5 k6, as in OpenCV. The last three are 0 in its plain model.
  std::array<double, 8> distortion{};

  bool operator==(const Intrinsics&) const = default;
};

/// The coefficients of the lens as files hold them: the five of the plain model, or all eight.
[[nodiscard]] std::span<const double> LensCoefficients(const Intrinsics& intrinsics);
/// Takes over five or eight; false for any other number, which changes nothing.
[[nodiscard]] bool SetLensCoefficients(std::span<const double> coefficients,
                                       Intrinsics& intrinsics);
[[nodiscard]] bool HasLens(const Intrinsics& intrinsics);

/// The radial factor of a lens at r2 = x² + y² in ideal normalised coordinates: (1 + k1 r2 + k2 r2²
/// + k3 r2³) / (1 + k4 r2 + k5 r2² + k6 r2³).
struct RadialFactor {
  double value = 1.0;
  double slope = 0.0;  ///< d value / d r2.
  double denominator = 1.0;
};
[[nodiscard]] RadialFactor RadialFactorAt(const std::array<double, 8>& distortion, double r2);

/// Distorted from ideal normalised coordinates (x/z, y/z).
[[nodiscard]] Eigen::Vector2d DistortNormalised(const Intrinsics& intrinsics,
                                                const Eigen::Vector2d& ideal);

/// Pixel of a point in the camera frame (z > 0), including the lens.
[[nodiscard]] Eigen::Vector2d Project(const Intrinsics& intrinsics,
                                      const Eigen::Vector3d& p_camera);

/// Ideal normalised coordinates (x/z, y/z) of a pixel. The lens is inverted by fixed-point
/// iteration: 20 rounds, accurate to 1e-9 for plain lenses of consumer sensors; 200 for rational
/// ones, which are wider and converge more slowly.
[[nodiscard]] Eigen::Vector2d Undistort(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel);

/// The same camera at another image size. Pixel centres are at integers, so cx' = (cx + 0.5) s -
/// 0.5.
[[nodiscard]] Intrinsics Resized(const Intrinsics& intrinsics, int width, int height);

}  // namespace plumb
