// The pinhole camera with OpenCV's five-parameter lens model.
#pragma once

#include <array>

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
  std::array<double, 5> distortion{};  ///< k1 k2 p1 p2 k3, as in OpenCV.

  bool operator==(const Intrinsics&) const = default;
};

/// Distorted from ideal normalised coordinates (x/z, y/z).
[[nodiscard]] Eigen::Vector2d DistortNormalised(const Intrinsics& intrinsics,
                                                const Eigen::Vector2d& ideal);

/// Pixel of a point in the camera frame (z > 0), including the lens.
[[nodiscard]] Eigen::Vector2d Project(const Intrinsics& intrinsics,
                                      const Eigen::Vector3d& p_camera);

/// Ideal normalised coordinates (x/z, y/z) of a pixel. The lens is inverted by fixed-point
/// iteration (20 rounds, accurate to 1e-9 for lenses of consumer sensors).
[[nodiscard]] Eigen::Vector2d Undistort(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel);

/// The same camera at another image size. Pixel centres are at integers, so cx' = (cx + 0.5) s -
/// 0.5.
[[nodiscard]] Intrinsics Resized(const Intrinsics& intrinsics, int width, int height);

}  // namespace plumb
