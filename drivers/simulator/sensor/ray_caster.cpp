// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/ray_caster.hpp"

#include <tbb/parallel_for.h>

#include <array>
#include <cmath>

namespace plumb::simulated {

namespace {

/// The angle whose distorted radius this is, by Newton's method.
double AngleOf(const std::array<double, 4>& k, double radius) {
  double theta = radius;
  for (int i = 0; i < 20; ++i) {
    const double t2 = theta * theta;
    const double value =
        theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) - radius;
    const double slope =
        1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])));
    theta -= value / slope;
  }
  return theta;
}

/// Through the lens without its rest.
Eigen::Vector2d UndistortMain(const Intrinsics& camera, const LensRest& rest,
                              const Eigen::Vector2d& pixel) {
  if (!rest.equidistant) return plumb::Undistort(camera, pixel);
  const Eigen::Vector2d distorted((pixel.x() - camera.cx) / camera.fx,
                                  (pixel.y() - camera.cy) / camera.fy);
  const double radius = distorted.norm();
  if (radius < 1e-9) return distorted;
  return std::tan(AngleOf(*rest.equidistant, radius)) / radius * distorted;
}

}  // namespace

Eigen::Vector2d Undistort(const Intrinsics& camera, const LensRest& rest,
                          const Eigen::Vector2d& pixel) {
  Eigen::Vector2d ideal = UndistortMain(camera, rest, pixel);
  if (rest.prism == std::array<double, 4>{} && rest.k4 == 0.0) return ideal;
  // The rest is a fraction of a pixel, over which the correction hardly changes.
  for (int i = 0; i < 4; ++i) {
    const double r2 = ideal.squaredNorm();
    const Eigen::Vector2d prism(r2 * (rest.prism[0] + rest.prism[1] * r2),
                                r2 * (rest.prism[2] + rest.prism[3] * r2));
    const Eigen::Vector2d added = prism + rest.k4 * r2 * r2 * r2 * r2 * ideal;
    ideal = UndistortMain(camera, rest,
                          pixel - Eigen::Vector2d(camera.fx * added.x(), camera.fy * added.y()));
  }
  return ideal;
}

PixelRays::PixelRays(const Intrinsics& camera, const LensRest& rest)
    : width_(camera.width), height_(camera.height), focal_px_(static_cast<float>(camera.fx)) {
  // One additional pixel on every side, for the differences.
  const auto across = static_cast<std::size_t>(width_ + 2);
  std::vector<Eigen::Vector2d> ideal(across * static_cast<std::size_t>(height_ + 2));
  tbb::parallel_for(-1, height_ + 1, [&](int y) {
    for (int x = -1; x <= width_; ++x)
      ideal[static_cast<std::size_t>(y + 1) * across + static_cast<std::size_t>(x + 1)] =
          Undistort(camera, rest, {x, y});
  });
  for (std::vector<float>* values : {&x_, &y_, &x_du_, &x_dv_, &y_du_, &y_dv_})
    values->reserve(Index(0, height_));
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const Eigen::Vector2d* centre =
          &ideal[static_cast<std::size_t>(y + 1) * across + static_cast<std::size_t>(x + 1)];
      const Eigen::Vector2f du = (0.5 * (centre[1] - centre[-1])).cast<float>();
      const Eigen::Vector2f dv = (0.5 * (*(centre + across) - *(centre - across))).cast<float>();
      x_.push_back(static_cast<float>(centre->x()));
      y_.push_back(static_cast<float>(centre->y()));
      x_du_.push_back(du.x());
      x_dv_.push_back(dv.x());
      y_du_.push_back(du.y());
      y_dv_.push_back(dv.y());
    }
  }
}

MovingPose PoseAt(const Trajectory& trajectory, double time_s, const Pose& T_carrier_camera) {
  constexpr double kStep = 5e-4;
  const Pose before = trajectory.T_world_camera(time_s - kStep) * T_carrier_camera;
  const Pose after = trajectory.T_world_camera(time_s + kStep) * T_carrier_camera;
  const Pose now = trajectory.T_world_camera(time_s) * T_carrier_camera;
  MovingPose moving;
  moving.R_world_camera = now.linear().cast<float>();
  moving.p_world = now.translation().cast<float>();
  moving.velocity = ((after.translation() - before.translation()) / (2 * kStep)).cast<float>();
  moving.angular_velocity =
      (VectorFromRotation(after.linear() * before.linear().transpose()) / (2 * kStep))
          .cast<float>();
  return moving;
}

}  // namespace plumb::simulated
