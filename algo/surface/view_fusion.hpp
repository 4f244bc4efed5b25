// SPDX-License-Identifier: Apache-2.0
// Compares one surface point with all views and finds where they agree that the surface lies.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "algo/surface/view_surface.hpp"

namespace plumb {

struct FusionOptions {
  /// Views within this distance of the seed (or 4 sigma, if larger) measured the same surface.
  float min_band_m = 0.010F;
  float see_through_m =
      0.03F;                 ///< Views that see this far past the seed show that nothing is there.
  bool with_normals = true;  ///< False: FusedPoint::normal is the seed's.
  /// Number of views that ViewsNear() keeps; noise falls only with the square root.
  int max_views = 16;
};

/// The evidence of all views for one seed point.
struct FusedPoint {
  float offset_m =
      0.0F;  ///< Robust weighted mean of the surface's signed distance along the seed's normal.
  float weight = 0.0F;   ///< Sum of the views' weights, 1/m^2.
  int num_agreeing = 0;  ///< Views that measured the surface within the band.
  int num_through = 0;   ///< Views that see through the seed.
  /// Index of the agreeing view with the largest weight, if a view agrees.
  std::optional<std::uint16_t> best_view;
  std::uint32_t best_pixel = 0;  ///< Working pixel of the best view.
  Eigen::Vector3f normal =
      Eigen::Vector3f::Zero();  ///< Weighted mean of the agreeing views; world frame, unit length.
};

/// Projects points into prepared views (projective association) and averages their measurements.
/// Borrows the views. Const members are thread-safe and deterministic.
class ViewFusion {
 public:
  ViewFusion(std::span<const ViewSurface> views, const FusionOptions& options);

  /// @param p_world, n_world  Seed point (metres) and unit normal towards the sensor.
  /// @param candidates  Indices of the views to use, in the order that resolves ties.
  [[nodiscard]] FusedPoint Fuse(const Eigen::Vector3f& p_world, const Eigen::Vector3f& n_world,
                                std::span<const std::uint16_t> candidates) const;

  /// Views whose frustum intersects the ball and that see the side to which the normal points; the
  /// least noisy ones, ascending.
  void ViewsNear(const Eigen::Vector3f& centre_world, float radius_m,
                 const Eigen::Vector3f& n_world, std::vector<std::uint16_t>& found) const;

  /// Signed distance (metres, along the normal) from a point to the surface that one view measured
  /// there; nothing where that view does not show it well. May be far: another surface, or none.
  [[nodiscard]] std::optional<float> Distance(std::size_t view, const Eigen::Vector3f& p_world,
                                              const Eigen::Vector3f& n_world) const;

 private:
  /// A seed seen in a view, between two working pixels each way.
  struct Seen {
    Eigen::Vector3f p;  ///< Camera frame.
    float inverse_z;
    float fu, fv;  ///< Shares of the way to the next column and row.
    std::uint32_t top_left;
    std::uint16_t index;
  };
  struct Measured {
    float distance_m;  ///< Along the normal.
    float beyond;      ///< Beyond the seed, as a fraction of the seed's distance from the camera.
  };
  struct Camera {
    const ViewSurface* view = nullptr;
    Eigen::Matrix3f R_camera_world;
    Eigen::Vector3f t_camera_world;
    float fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6;
    bool has_lens = false;
    Eigen::Vector2f ray_min, ray_max;  ///< Extent of the whole image.
    std::array<Eigen::Vector3f, 4>
        inward_sides;  ///< Unit normals of the frustum's sides in the camera frame.
    float max_depth_m = 0.0F;
  };

  [[nodiscard]] bool Project(std::uint16_t index, const Eigen::Vector3f& p_world, Seen& seen) const;

  [[nodiscard]] bool Measure(const Seen& seen, const Eigen::Vector3f& n_world,
                             Measured& measured) const;

  FusionOptions options_;
  std::vector<Camera> cameras_;
};

}  // namespace plumb
