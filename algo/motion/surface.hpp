// SPDX-License-Identifier: Apache-2.0
// Evenly thinned surface samples and the search for the nearest of them.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "algo/types/height_map.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Samples of a surface, one per voxel, with normals smoothed over a neighbourhood. Metres; the
/// frame is stated by the owner.
struct Surface {
  std::vector<Eigen::Vector3f> points;
  std::vector<Eigen::Vector3f> normals;  ///< Unit length, pointing outward.
  std::vector<std::uint8_t>
      inner;               ///< 0 at rims (of the scanned part, of holes) and for isolated samples.
  double spacing_m = 0.0;  ///< Voxel edge length.

  [[nodiscard]] std::size_t size() const { return points.size(); }
};

/// Surfaces with fewer samples are not registered.
inline constexpr std::size_t kMinSurfaceSamples = 50;

/// Transforms the cloud: p_a = T_a_b * p_b. Normals are rotated, colours dropped. T_a_b is rigid
/// apart from a small stretch.
[[nodiscard]] PointCloud TransformedCloud(const Eigen::Affine3d& T_a_b,
                                          const PointCloud& cloud_in_b);

/// One point per cell with normals by central differences, for scenes without a cloud.
[[nodiscard]] PointCloud CloudOfHeightMap(const HeightMap& map);

/// Thins to the mean of each voxel, smooths normals over `smoothing_m` and marks rims. Samples are
/// ordered by voxel.
[[nodiscard]] Surface MakeSurface(const PointCloud& cloud, double spacing_m, double smoothing_m);

/// The samples of a surface whose index `keep` accepts, with their attributes.
[[nodiscard]] Surface Subset(const Surface& surface, const std::function<bool(std::size_t)>& keep);

/// Finds the nearest samples within a fixed radius, with the samples sorted into cubes of that
/// size. Copies the points.
class NearestSample {
 public:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  NearestSample(const std::vector<Eigen::Vector3f>& points, double radius_m);

  /// Index of the nearest point within the radius, or kNone. Thread-safe.
  [[nodiscard]] std::uint32_t Find(const Eigen::Vector3f& p) const;

  /// Calls visit(index, squared distance) for every point within the radius, in a fixed order.
  /// Thread-safe.
  template <typename Visit>
  void ForEach(const Eigen::Vector3f& p, Visit&& visit) const;

 private:
  struct Range {
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
  };
  [[nodiscard]] Eigen::Array3i CubeOf(const Eigen::Vector3f& p) const {
    return ((p - origin_).array() * inverse_size_).floor().cast<int>();
  }
  [[nodiscard]] Range Row(int x_first, int x_last, int y, int z) const {
    const std::size_t row = (static_cast<std::size_t>(z) * static_cast<std::size_t>(cubes_[1]) +
                             static_cast<std::size_t>(y)) *
                            static_cast<std::size_t>(cubes_[0]);
    return {first_[row + static_cast<std::size_t>(x_first)],
            first_[row + static_cast<std::size_t>(x_last) + 1]};
  }
  /// Calls visit(position in sorted_) over the 27 cubes around p.
  template <typename Visit>
  void Scan(const Eigen::Vector3f& p, Visit&& visit) const;

  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();
  float inverse_size_ = 1.0F;
  float squared_radius_ = 0.0F;
  Eigen::Array3i cubes_ = Eigen::Array3i::Zero();
  std::vector<std::uint32_t> first_;     ///< Start of each cube in sorted_, plus one final entry.
  std::vector<Eigen::Vector3f> sorted_;  ///< Points by cube, x fastest.
  std::vector<std::uint32_t> index_;     ///< Their indices in the caller's order.
};

template <typename Visit>
void NearestSample::Scan(const Eigen::Vector3f& p, Visit&& visit) const {
  if (sorted_.empty() || !p.allFinite()) return;
  // Compared before the cast to int, which would overflow for distant queries.
  const Eigen::Array3f relative = (p - origin_).array() * inverse_size_;
  if ((relative < -1.0F).any() || (relative > cubes_.cast<float>() + 1.0F).any()) return;
  const Eigen::Array3i low = (CubeOf(p) - 1).max(0);
  const Eigen::Array3i high = (CubeOf(p) + 1).min(cubes_ - 1);
  if ((low > high).any()) return;
  for (int z = low[2]; z <= high[2]; ++z) {
    for (int y = low[1]; y <= high[1]; ++y) {
      const Range range = Row(low[0], high[0], y, z);
      for (std::uint32_t k = range.begin; k < range.end; ++k) visit(k);
    }
  }
}

template <typename Visit>
void NearestSample::ForEach(const Eigen::Vector3f& p, Visit&& visit) const {
  Scan(p, [&](std::uint32_t k) {
    const float squared = (sorted_[k] - p).squaredNorm();
    if (squared <= squared_radius_) visit(index_[k], squared);
  });
}

}  // namespace plumb
