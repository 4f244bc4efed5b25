// SPDX-License-Identifier: Apache-2.0
// Depth images of a smooth analytic surface on a floor: exact truth for surfaces, heights and
// normals.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/geometry/back_projection.hpp"
#include "algo/types/keyframe.hpp"

namespace plumb::testing {

/// A half ellipsoid (semi-axes a, b, c; centre on the floor z = 0 at (x, y)) on an unbounded floor.
/// Metres.
struct DomeScene {
  double x = 0.5, y = 0.35;
  double a = 0.30, b = 0.20, c = 0.15;

  /// True height over the floor.
  [[nodiscard]] double Height(double px, double py) const {
    const double u = (px - x) / a;
    const double v = (py - y) / b;
    const double inside = 1.0 - u * u - v * v;
    return inside > 0.0 ? c * std::sqrt(inside) : 0.0;
  }

  /// Outward normal on the dome or the floor.
  [[nodiscard]] Eigen::Vector3d Normal(double px, double py) const {
    const double z = Height(px, py);
    if (z == 0.0) return Eigen::Vector3d::UnitZ();
    return Eigen::Vector3d((px - x) / (a * a), (py - y) / (b * b), z / (c * c)).normalized();
  }

  /// Distance along a ray to the first surface, or 0.
  [[nodiscard]] double Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
    const Eigen::Vector3d scale(1 / a, 1 / b, 1 / c);
    const Eigen::Vector3d o = (origin - Eigen::Vector3d(x, y, 0)).cwiseProduct(scale);
    const Eigen::Vector3d d = direction.cwiseProduct(scale);
    const double half = o.dot(d);
    const double discriminant = half * half - d.squaredNorm() * (o.squaredNorm() - 1.0);
    double nearest = 0.0;
    if (direction.z() < 0.0) nearest = -origin.z() / direction.z();
    if (discriminant > 0.0) {
      const double hit = (-half - std::sqrt(discriminant)) / d.squaredNorm();
      if (hit > 0.0 && (origin + hit * direction).z() > 0.0 && (nearest == 0.0 || hit < nearest))
        nearest = hit;
    }
    return nearest;
  }
};

/// Camera at `position` that looks at `target`, image x along the world's x as far as that goes.
inline Pose LookAt(const Eigen::Vector3d& position, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - position).normalized();
  const Eigen::Vector3d down =
      (-Eigen::Vector3d::UnitY() + Eigen::Vector3d::UnitY().dot(forward) * forward).normalized();
  Pose T_world_camera = Pose::Identity();
  T_world_camera.linear().col(0) = down.cross(forward);
  T_world_camera.linear().col(1) = down;
  T_world_camera.linear().col(2) = forward;
  T_world_camera.translation() = position;
  return T_world_camera;
}

/// Exact depth, plus independent noise of `noise_m` if asked for. The colour of a pixel codes its
/// world place.
inline DepthView RenderDome(const DomeScene& scene, const RayTable& rays,
                            const Pose& T_world_camera, double noise_m, unsigned seed) {
  const Intrinsics& intrinsics = rays.intrinsics();
  DepthView view;
  view.intrinsics = intrinsics;
  view.T_world_camera = T_world_camera;
  view.depth_m = cv::Mat::zeros(intrinsics.height, intrinsics.width, CV_32FC1);
  view.color_rgb = cv::Mat::zeros(intrinsics.height, intrinsics.width, CV_8UC3);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  for (int row = 0; row < intrinsics.height; ++row) {
    for (int column = 0; column < intrinsics.width; ++column) {
      const Eigen::Vector3d ray = rays.ideal(row, column).cast<double>().homogeneous();
      const double z = scene.Cast(T_world_camera.translation(), T_world_camera.linear() * ray);
      if (!(z > 0.0 && z < 4.0)) continue;
      view.depth_m.at<float>(row, column) = static_cast<float>(z + noise_m * normal(random));
      const Eigen::Vector3d p = T_world_camera * (z * ray);
      view.color_rgb.at<cv::Vec3b>(row, column) = {
          static_cast<unsigned char>(p.z() > 1e-6 ? 200 : 50), 100, 30};
    }
  }
  return view;
}

/// Adds to the depth of a rectangle of pixels, all of them.
inline void ShiftDepth(DepthView& view, const cv::Rect& pixels, float shift_m) {
  for (int row = pixels.y; row < pixels.y + pixels.height; ++row)
    for (int column = pixels.x; column < pixels.x + pixels.width; ++column)
      view.depth_m.at<float>(row, column) += shift_m;
}

/// A sweep of `count` views over the dome, at about 0.9 m, swinging sideways.
inline std::vector<DepthView> SweepOverDome(const DomeScene& scene, int count, int width,
                                            double noise_m) {
  Intrinsics intrinsics = Resized({}, width, width * 3 / 4);
  intrinsics.distortion = {0.05, -0.12, 0.001, -0.0008, 0.02};
  const RayTable rays(intrinsics);
  std::vector<DepthView> views;
  for (int i = 0; i < count; ++i) {
    const double along = (i + 0.5) / count;
    const Eigen::Vector3d target(scene.x - 0.3 + 0.6 * along, scene.y, 0.05);
    const Eigen::Vector3d position(target.x() - 0.1 + 0.2 * along,
                                   scene.y + 0.35 * std::sin(9.0 * along), 0.95);
    views.push_back(
        RenderDome(scene, rays, LookAt(position, target), noise_m, static_cast<unsigned>(i + 1)));
  }
  return views;
}

}  // namespace plumb::testing
