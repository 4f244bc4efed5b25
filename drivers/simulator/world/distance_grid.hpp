// SPDX-License-Identifier: Apache-2.0
// A closed smooth surface as signed distances on a regular grid, with fast ray casting, normals and
// a mesh.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "algo/types/point_cloud.hpp"
#include "drivers/simulator/world/float4.hpp"

namespace plumb::simulated {

/// Signed distance to a surface, sampled at grid nodes with trilinear interpolation, negative
/// inside. Metres, in the surface's own frame. The surface *is* the zero set of the interpolated
/// values, so that rays, normals and mesh agree. Immutable after construction, so it may be read
/// from any number of threads.
class DistanceGrid {
 public:
  /// @param implicit  Negative inside, positive outside, smooth near its zero set; need not be a
  ///         distance. Called from several threads.
  /// @param box       Contains the whole surface with a margin of at least two cells on every side.
  /// @param spacing   Grid step, metres, > 0.
  DistanceGrid(const std::function<double(const Eigen::Vector3d&)>& implicit,
               const Eigen::AlignedBox3d& box, double spacing);

  /// Between three shapes on the same grid: base + a (shape_a - base) + b (shape_b - base). For
  /// shapes that differ by little, such as a body's while it breathes.
  /// @throws std::invalid_argument for grids of different boxes.
  [[nodiscard]] static DistanceGrid Between(const DistanceGrid& base, const DistanceGrid& shape_a,
                                            double a, const DistanceGrid& shape_b, double b);

  /// Signed distance; outside the box, the value at the nearest point of the box plus the distance
  /// to it.
  [[nodiscard]] float Distance(const Eigen::Vector3f& p) const;

  /// Outward unit normal (x, y, z) and openness (w) near the surface, both interpolated between the
  /// nodes, so they vary smoothly. Openness is 1 where no part of the body is close in front of the
  /// surface and falls towards 0 in creases.
  [[nodiscard]] Eigen::Vector4f Shade(const Eigen::Vector3f& p) const;
  [[nodiscard]] Eigen::Vector3f Normal(const Eigen::Vector3f& p) const {
    return Shade(p).head<3>();
  }

  /// Distance along the ray to the surface, at or after t_begin and before t_end; infinity if it is
  /// not hit.
  /// @param direction  Unit length.
  [[nodiscard]] float Intersect(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                                float t_begin, float t_end) const;

  /// The same for four rays, at little more than the cost of one.
  /// @param origin, direction  In the surface's own frame.
  [[nodiscard]] Float4 Intersect(const Vector3x4& origin, const Vector3x4& direction,
                                 Float4 t_begin, Float4 t_end) const;

  /// Distance by which a cone around the ray may advance before it can touch the surface; infinity
  /// if it never does.
  /// @param spread  Radius of the cone per metre.
  /// @param margin  Radius at the origin, metres.
  [[nodiscard]] float ConeStart(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                                float spread, float margin, float t_end) const;

  /// The surface as triangles, counter-clockwise seen from outside; vertices lie on the zero set.
  [[nodiscard]] TriangleMesh Surface() const;

  [[nodiscard]] const Eigen::AlignedBox3f& box() const { return box_; }

 private:
  [[nodiscard]] std::size_t Index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(size_.y()) +
            static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(size_.x()) +
           static_cast<std::size_t>(x);
  }
  /// A cell and the position in it.
  struct Place {
    std::size_t index;
    float x, y, z;  ///< In [0, 1].
  };
  [[nodiscard]] Place Locate(float gx, float gy, float gz) const;  ///< From coordinates in cells.
  [[nodiscard]] float ValueAt(const Place& at) const;
  [[nodiscard]] float Interpolate(const Eigen::Vector3f& p) const;
  [[nodiscard]] Eigen::Vector3f GradientAtNode(int x, int y, int z) const;
  void BuildShades();
  [[nodiscard]] std::vector<char> NormaliseNearSurface();
  void PropagateDistances(const std::vector<char>& fixed);
  /// Values at four positions, given in cells.
  [[nodiscard]] Float4 ValuesAt(Float4 gx, Float4 gy, Float4 gz) const;

  Eigen::AlignedBox3f box_;
  Eigen::Vector3i size_;
  Eigen::Vector3f last_;  ///< Largest coordinates in cells that still have a neighbour.
  std::size_t row_ = 0;  ///< Offsets between nodes of neighbouring rows and of neighbouring slices.
  std::size_t slice_ = 0;
  float spacing_;
  float inverse_spacing_;
  std::vector<float> values_;
  std::vector<std::uint32_t> shade_of_node_;  ///< Index into shades_; 0 away from the surface.
  std::vector<Eigen::Vector4f, Eigen::aligned_allocator<Eigen::Vector4f>> shades_;
};

}  // namespace plumb::simulated
