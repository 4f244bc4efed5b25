// SPDX-License-Identifier: Apache-2.0
// Rays of one moving camera: direction and origin of each pixel at any time.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "algo/base/intrinsics.hpp"
#include "drivers/simulator/sensor/sensor_unit.hpp"
#include "drivers/simulator/world/trajectory.hpp"
#include "drivers/simulator/world/world.hpp"

namespace plumb::simulated {

inline constexpr int kTileSize = 8;  ///< Pixels; the rays of one tile share their candidates.

/// Ideal normalised coordinates of a pixel, through the complete lens model.
[[nodiscard]] Eigen::Vector2d Undistort(const Intrinsics& camera, const LensRest& rest,
                                        const Eigen::Vector2d& pixel);

/// Direction of each pixel in the camera frame. Created once per camera.
class PixelRays {
 public:
  explicit PixelRays(const Intrinsics& camera, const LensRest& rest = {});
  /// Ray through a position near the centre of pixel (x, y), du and dv pixels away; z = 1. Linear
  /// in du, dv over a few pixels.
  [[nodiscard]] Eigen::Vector3f At(int x, int y, float du, float dv) const {
    const std::size_t i = Index(x, y);
    return {x_[i] + du * x_du_[i] + dv * x_dv_[i], y_[i] + du * y_du_[i] + dv * y_dv_[i], 1.0F};
  }
  /// Rays through four positions near the centre of one pixel.
  [[nodiscard]] Vector3x4 At(int x, int y, Float4 du, Float4 dv) const {
    const std::size_t i = Index(x, y);
    return {x_[i] + du * x_du_[i] + dv * x_dv_[i], y_[i] + du * y_du_[i] + dv * y_dv_[i],
            Splat(1.0F)};
  }
  /// Rays through the centres of the pixels x to x + 3 of a row.
  [[nodiscard]] Vector3x4 FourFrom(int x, int y) const {
    const std::size_t i = Index(x, y);
    return {Load(&x_[i]), Load(&y_[i]), Splat(1.0F)};
  }
  /// Rays through a position near each of them.
  [[nodiscard]] Vector3x4 FourFrom(int x, int y, Float4 du, Float4 dv) const {
    const std::size_t i = Index(x, y);
    return {Load(&x_[i]) + du * Load(&x_du_[i]) + dv * Load(&x_dv_[i]),
            Load(&y_[i]) + du * Load(&y_du_[i]) + dv * Load(&y_dv_[i]), Splat(1.0F)};
  }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] float focal_px() const { return focal_px_; }

 private:
  [[nodiscard]] std::size_t Index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  int width_;
  int height_;
  float focal_px_;
  std::vector<float> x_, y_, x_du_, x_dv_, y_du_, y_dv_;  ///< Per pixel.
};

/// A camera's pose with its velocity, from which poses within a few milliseconds are computed
/// cheaply.
struct MovingPose {
  Eigen::Matrix3f R_world_camera = Eigen::Matrix3f::Identity();
  Eigen::Vector3f p_world = Eigen::Vector3f::Zero();
  Eigen::Vector3f velocity = Eigen::Vector3f::Zero();          ///< World frame, m/s.
  Eigen::Vector3f angular_velocity = Eigen::Vector3f::Zero();  ///< World frame, rad/s.

  /// World direction of a camera-frame direction, not normalised.
  [[nodiscard]] Eigen::Vector3f DirectionOf(const Eigen::Vector3f& direction_camera,
                                            float dt) const {
    const Eigen::Vector3f direction = R_world_camera * direction_camera;
    return direction + dt * angular_velocity.cross(direction);
  }
  /// Ray of a camera-frame direction, dt seconds after the time of the pose. Exact to second order
  /// in the rotation (below 0.01 pixel).
  [[nodiscard]] Ray RayOf(const Eigen::Vector3f& direction_camera, float dt) const {
    return {p_world + dt * velocity, DirectionOf(direction_camera, dt).normalized()};
  }
  [[nodiscard]] Vector3x4 DirectionOf(const Vector3x4& direction_camera, Float4 dt) const {
    const Vector3x4 direction = R_world_camera * direction_camera;
    return direction + dt * Cross(angular_velocity, direction);
  }
  [[nodiscard]] Ray4 RayOf(const Vector3x4& direction_camera, Float4 dt) const {
    return Ray4(dt * velocity + p_world, DirectionOf(direction_camera, dt));
  }
  /// At the time of the pose.
  [[nodiscard]] Ray4 RayOf(const Vector3x4& direction_camera) const {
    return Ray4(Splat(p_world), R_world_camera * direction_camera);
  }
};

/// @param T_carrier_camera  Pose of this camera relative to the camera that the trajectory moves
///         (the colour camera).
[[nodiscard]] MovingPose PoseAt(const Trajectory& trajectory, double time_s,
                                const Pose& T_carrier_camera);

}  // namespace plumb::simulated
