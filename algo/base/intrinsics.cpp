#include "algo/base/intrinsics.hpp"

namespace plumb {

Eigen::Vector2d DistortNormalised(const Intrinsics& intrinsics, const Eigen::Vector2d& ideal) {
  const auto& [k1, k2, p1, p2, k3] = intrinsics.distortion;
  const double x = ideal.x();
  const double y = ideal.y();
  const double r2 = x * x + y * y;
  const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
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
  if (intrinsics.distortion == std::array<double, 5>{}) return distorted;
  const auto& [k1, k2, p1, p2, k3] = intrinsics.distortion;
  Eigen::Vector2d ideal = distorted;
  for (int i = 0; i < 20; ++i) {
    const double x = ideal.x();
    const double y = ideal.y();
    const double r2 = x * x + y * y;
    const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
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
