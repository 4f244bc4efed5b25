// SPDX-License-Identifier: Apache-2.0
#include "algo/motion/surface.hpp"

#include <algorithm>
#include <cmath>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace plumb {
namespace {

// points farther away are treated as damaged data, since a scan covers one room at most
constexpr float kMaxExtent_m = 20.0F;
constexpr std::size_t kMaxCubes = 16'000'000;  // limits the memory of one search structure to 64 MB
constexpr float kRimOffset =
    0.25F;  // distance of the neighbours' centroid from the sample in radii; half a disc gives 0.42
constexpr int kMinNeighbours = 6;  // a full neighbourhood has pi (3 spacings)^2 = 28 samples

struct VoxelEntry {
  std::uint64_t voxel;
  std::uint32_t index;
  bool operator<(const VoxelEntry& other) const {
    return voxel != other.voxel ? voxel < other.voxel : index < other.index;
  }
};

std::vector<VoxelEntry> SortedByVoxel(const PointCloud& cloud, double spacing_m) {
  const float inverse = static_cast<float>(1.0 / spacing_m);
  std::vector<VoxelEntry> entries;
  entries.reserve(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3f& p = cloud.points[i];
    if (!(p.cwiseAbs().maxCoeff() < kMaxExtent_m) || !cloud.normals[i].allFinite()) continue;
    const Eigen::Array3f v = ((p.array() + kMaxExtent_m) * inverse).floor();
    const auto key = [](float x) { return static_cast<std::uint64_t>(x) & 0x1FFFFF; };
    entries.push_back(
        {(key(v[2]) << 42) | (key(v[1]) << 21) | key(v[0]), static_cast<std::uint32_t>(i)});
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

// Smooths the normal of one sample and decides whether it lies in the interior of its surface.
void Smooth(const Surface& raw, const NearestSample& neighbours, float radius, std::size_t i,
            Surface& out) {
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  Eigen::Vector3f offset = Eigen::Vector3f::Zero();
  int count = 0;
  neighbours.ForEach(raw.points[i], [&](std::uint32_t k, float squared) {
    // belongs to the opposite side of a thin part
    if (raw.normals[k].dot(raw.normals[i]) < 0.3F) return;
    const float w = 1.0F - squared / (radius * radius);
    normal += w * raw.normals[k];
    offset += raw.points[k] - raw.points[i];
    ++count;
  });
  const float length = normal.norm();
  out.normals[i] = length > 0 ? Eigen::Vector3f(normal / length) : raw.normals[i];
  offset /= static_cast<float>(std::max(count, 1));
  offset -= offset.dot(out.normals[i]) * out.normals[i];
  out.inner[i] = count >= kMinNeighbours && offset.norm() < kRimOffset * radius ? 1 : 0;
}

}  // namespace

PointCloud TransformedCloud(const Eigen::Affine3d& T_a_b, const PointCloud& cloud_in_b) {
  PointCloud cloud_in_a;
  const Eigen::Matrix3f R = T_a_b.rotation().cast<float>();
  cloud_in_a.points.reserve(cloud_in_b.size());
  cloud_in_a.normals.reserve(cloud_in_b.normals.size());
  // Computed in double, because float would lose digits in a scene frame far from the reference.
  for (const Eigen::Vector3f& p : cloud_in_b.points)
    cloud_in_a.points.emplace_back((T_a_b * p.cast<double>()).cast<float>());
  for (const Eigen::Vector3f& n : cloud_in_b.normals) cloud_in_a.normals.emplace_back(R * n);
  return cloud_in_a;
}

PointCloud CloudOfHeightMap(const HeightMap& map) {
  PointCloud cloud;
  const GridShape& grid = map.grid;
  for (int row = 1; row + 1 < grid.height; ++row) {
    for (int column = 1; column + 1 < grid.width; ++column) {
      const float z = map.at(row, column);
      const float dx = map.at(row, column + 1) - map.at(row, column - 1);
      const float dy = map.at(row + 1, column) - map.at(row - 1, column);
      if (!std::isfinite(z) || !std::isfinite(dx) || !std::isfinite(dy)) continue;
      cloud.points.emplace_back(static_cast<float>(grid.x_centre(column)),
                                static_cast<float>(grid.y_centre(row)), z);
      cloud.normals.push_back(
          Eigen::Vector3f(-dx, -dy, static_cast<float>(2 * grid.step)).normalized());
    }
  }
  return cloud;
}

Surface MakeSurface(const PointCloud& cloud, double spacing_m, double smoothing_m) {
  const std::vector<VoxelEntry> entries = SortedByVoxel(cloud, spacing_m);
  Surface raw;
  raw.spacing_m = spacing_m;
  for (std::size_t begin = 0; begin < entries.size();) {
    std::size_t end = begin;
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    for (; end < entries.size() && entries[end].voxel == entries[begin].voxel; ++end) {
      point += cloud.points[entries[end].index].cast<double>();
      normal += cloud.normals[entries[end].index];
    }
    if (normal.norm() > 1e-6F) {
      raw.points.emplace_back((point / static_cast<double>(end - begin)).cast<float>());
      raw.normals.emplace_back(normal.normalized());
    }
    begin = end;
  }
  raw.inner.assign(raw.size(), 1);
  Surface smoothed = raw;
  const NearestSample neighbours(raw.points, smoothing_m);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, raw.size(), 512),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i < range.end(); ++i)
                        Smooth(raw, neighbours, static_cast<float>(smoothing_m), i, smoothed);
                    });
  return smoothed;
}

Surface Subset(const Surface& surface, const std::function<bool(std::size_t)>& keep) {
  Surface subset;
  subset.spacing_m = surface.spacing_m;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    if (!keep(i)) continue;
    subset.points.push_back(surface.points[i]);
    subset.normals.push_back(surface.normals[i]);
    subset.inner.push_back(surface.inner[i]);
  }
  return subset;
}

NearestSample::NearestSample(const std::vector<Eigen::Vector3f>& points, double radius_m) {
  squared_radius_ = static_cast<float>(radius_m * radius_m);
  if (points.empty()) return;
  Eigen::Vector3f low = points.front();
  Eigen::Vector3f high = points.front();
  for (const Eigen::Vector3f& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  double size = radius_m;
  const auto cubes_at = [&](double edge) {
    return Eigen::Array3d(((high - low).cast<double>().array() / edge).floor() + 1.0);
  };
  while (cubes_at(size).prod() > static_cast<double>(kMaxCubes)) size *= 1.5;
  origin_ = low;
  inverse_size_ = static_cast<float>(1.0 / size);
  // one spare cube, because float and double may round to different cubes at the end
  cubes_ = cubes_at(size).cast<int>() + 1;

  const auto slot = [&](const Eigen::Vector3f& p) {
    const Eigen::Array3i c = CubeOf(p).max(0).min(cubes_ - 1);
    return (static_cast<std::size_t>(c[2]) * static_cast<std::size_t>(cubes_[1]) +
            static_cast<std::size_t>(c[1])) *
               static_cast<std::size_t>(cubes_[0]) +
           static_cast<std::size_t>(c[0]);
  };
  first_.assign(static_cast<std::size_t>(cubes_.cast<double>().prod()) + 1, 0);
  std::vector<std::size_t> slots(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    slots[i] = slot(points[i]);
    ++first_[slots[i] + 1];
  }
  for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  sorted_.resize(points.size());
  index_.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::uint32_t k = next[slots[i]]++;
    sorted_[k] = points[i];
    index_[k] = static_cast<std::uint32_t>(i);
  }
}

std::uint32_t NearestSample::Find(const Eigen::Vector3f& p) const {
  std::uint32_t best = kNone;
  float best_squared = squared_radius_;
  Scan(p, [&](std::uint32_t k) {
    const float squared = (sorted_[k] - p).squaredNorm();
    if (squared > best_squared ||
        (squared == best_squared && best != kNone && index_[k] > index_[best]))
      return;
    best = k;
    best_squared = squared;
  });
  return best == kNone ? kNone : index_[best];
}

}  // namespace plumb
