// SPDX-License-Identifier: Apache-2.0
#include "algo/surface/surface_cloud.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

#include "algo/base/check_stop.hpp"
#include "algo/surface/view_fusion.hpp"

namespace plumb {
namespace {

// parts of space processed in parallel; fixed, so that results do not depend on the number of
// threads
constexpr std::size_t kNumShards = 32;
constexpr std::size_t kViewsAtOnce = 16;  // limits the memory of samples that wait for their shard
constexpr int kBlockBits =
    4;  // voxels per block and axis, as a power of two; a block shares its list of views
constexpr int kKeyBits = 21;  // per axis: +-3 km at 3 mm
constexpr int kKeyOffset = 1 << (kKeyBits - 1);
constexpr double kMaxDistance = 1000.0;
constexpr std::size_t kMaxSeeds = 3'000'000;  // a scene that would need more gets larger voxels

/// Voxel indices packed so that the voxels of one block are neighbours in key order.
using Key = std::uint64_t;

Key KeyOf(const Eigen::Vector3f& p, float inverse_size) {
  Key block = 0;
  Key within = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const Key index =
        static_cast<Key>(static_cast<int>(std::floor(p[axis] * inverse_size)) + kKeyOffset);
    block = (block << (kKeyBits - kBlockBits)) | (index >> kBlockBits);
    within = (within << kBlockBits) | (index & ((1U << kBlockBits) - 1U));
  }
  return (block << (3 * kBlockBits)) | within;
}

/// The voxel `step` further along an axis (0 x, 1 y, 2 z).
Key Beside(Key key, int axis, int step) {
  const int at_within = kBlockBits * (2 - axis);
  const int at_block = 3 * kBlockBits + (kKeyBits - kBlockBits) * (2 - axis);
  constexpr Key kWithin = (1U << kBlockBits) - 1U;
  constexpr Key kBlock = (1U << (kKeyBits - kBlockBits)) - 1U;
  const Key index =
      ((((key >> at_block) & kBlock) << kBlockBits) | ((key >> at_within) & kWithin)) +
      static_cast<Key>(static_cast<std::int64_t>(step));
  key &= ~((kWithin << at_within) | (kBlock << at_block));
  return key | ((index & kWithin) << at_within) | (((index >> kBlockBits) & kBlock) << at_block);
}

Key BlockOf(Key key) { return key >> (3 * kBlockBits); }
Key Mix(Key key) {
  key *= 0x9E3779B97F4A7C15ULL;
  return key ^ (key >> 29);
}
std::size_t ShardOf(Key key) { return (Mix(BlockOf(key)) >> 20) % kNumShards; }

/// Entries by voxel, in order of first insertion. Open addressing with the entries apart, so that
/// the free slots are small.
/// @tparam Entry  Has a `key`.
template <typename Entry>
class VoxelTable {
 public:
  [[nodiscard]] const std::vector<Entry>& entries() const { return entries_; }

  [[nodiscard]] const Entry* Find(Key key) const {
    if (slots_.empty()) return nullptr;
    const std::uint32_t index = slots_[SlotOf(key)];
    return index == kNone ? nullptr : &entries_[index];
  }

  /// The entry of this one's voxel, which becomes this one if there is none, and whether it did.
  std::pair<Entry&, bool> FindOrAdd(const Entry& entry) {
    if (2 * (entries_.size() + 1) > slots_.size()) Grow();
    std::uint32_t& index = slots_[SlotOf(entry.key)];
    const bool is_new = index == kNone;
    if (is_new) {
      index = static_cast<std::uint32_t>(entries_.size());
      entries_.push_back(entry);
    }
    return {entries_[index], is_new};
  }

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  /// The slot of a voxel's entry, or where it belongs.
  [[nodiscard]] std::size_t SlotOf(Key key) const {
    // Voxels of a block lie close together, five slots apart, so that filled planes do not form
    // long runs.
    constexpr Key kWithin = (Key{1} << (3 * kBlockBits)) - 1;
    std::size_t at = (Mix(BlockOf(key)) + 5 * (key & kWithin)) & (slots_.size() - 1);
    while (slots_[at] != kNone && entries_[slots_[at]].key != key)
      at = (at + 1) & (slots_.size() - 1);
    return at;
  }

  void Grow() {
    slots_.assign(std::max<std::size_t>(1024, 2 * slots_.size()), kNone);
    for (std::size_t i = 0; i < entries_.size(); ++i)
      slots_[SlotOf(entries_[i].key)] = static_cast<std::uint32_t>(i);
  }

  std::vector<std::uint32_t> slots_;
  std::vector<Entry> entries_;
};

/// A measured working pixel to be entered into a voxel.
struct VoxelSample {
  Key key;
  float weight;
  std::uint32_t pixel;
};

/// The best-weighted measurement of a voxel.
struct Seed {
  Key key;
  float weight;
  std::uint32_t pixel;
  std::uint32_t view;
  std::uint32_t count;  ///< measurements in the voxel
};

/// A seed moved onto the views' common surface.
struct Merged {
  Key key;
  Eigen::Vector3f point;
  Eigen::Vector3f normal;
  float weight;
  Color color;
};

template <typename T>
using Shards = std::array<std::vector<T>, kNumShards>;

Eigen::Vector3f PointInWorld(const ViewSurface& view, std::size_t pixel) {
  return view.T_world_camera.linear().cast<float>() * view.PointInCamera(pixel) +
         view.T_world_camera.translation().cast<float>();
}

void SortIntoShards(const ViewSurface& view, float inverse_size, Shards<VoxelSample>& shards) {
  for (auto& shard : shards) shard.clear();
  const Eigen::Matrix3f R = view.T_world_camera.linear().cast<float>();
  const Eigen::Vector3f t = view.T_world_camera.translation().cast<float>();
  for (std::size_t i = 0; i < view.size(); ++i) {
    if (view.pixels[i].weight <= 0.0F) continue;
    const Key key = KeyOf(R * view.PointInCamera(i) + t, inverse_size);
    shards[ShardOf(key)].push_back({key, view.pixels[i].weight, static_cast<std::uint32_t>(i)});
  }
}

using SeedTables = std::array<VoxelTable<Seed>, kNumShards>;

/// The seeds whose voxel holds at least as many measurements as its two neighbours along the
/// surface's normal. Noise spreads a surface over several layers of voxels, whose seeds would all
/// move to the same place.
std::vector<Seed> FullestLayers(std::span<const ViewSurface> views, const SeedTables& tables,
                                std::size_t shard) {
  const auto count_at = [&](Key key) {
    const Seed* const seed = tables[ShardOf(key)].Find(key);
    return seed == nullptr ? 0 : seed->count;
  };
  std::vector<Seed> kept;
  for (const Seed& seed : tables[shard].entries()) {
    const ViewSurface& view = views[seed.view];
    const Eigen::Vector3f n =
        view.T_world_camera.linear().cast<float>() * view.normals[seed.pixel].Unit();
    int axis = 0;
    n.cwiseAbs().maxCoeff(&axis);
    // Of two equally filled layers the lower one is kept.
    if (seed.count >= count_at(Beside(seed.key, axis, 1)) &&
        seed.count > count_at(Beside(seed.key, axis, -1)))
      kept.push_back(seed);
  }
  std::sort(kept.begin(), kept.end(), [](const Seed& a, const Seed& b) { return a.key < b.key; });
  return kept;
}

/// One seed per touched voxel, thinned to one layer, by shard, in block order within each.
Shards<Seed> FindSeeds(std::span<const ViewSurface> views, float inverse_size,
                       const std::stop_token& stop) {
  SeedTables tables;
  std::vector<Shards<VoxelSample>> samples(std::min(kViewsAtOnce, views.size()));
  for (std::size_t first = 0; first < views.size(); first += kViewsAtOnce) {
    CheckStop(stop);
    const std::size_t count = std::min(kViewsAtOnce, views.size() - first);
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
      CheckStop(stop);
      SortIntoShards(views[first + i], inverse_size, samples[i]);
    });
    tbb::parallel_for(std::size_t{0}, kNumShards, [&](std::size_t s) {
      for (std::size_t i = 0; i < count; ++i) {
        const auto number = static_cast<std::uint32_t>(first + i);
        for (const VoxelSample& sample : samples[i][s]) {
          const auto [seed, is_new] =
              tables[s].FindOrAdd({sample.key, sample.weight, sample.pixel, number, 0});
          ++seed.count;
          if (is_new || sample.weight <= seed.weight) continue;
          seed.weight = sample.weight;
          seed.pixel = sample.pixel;
          seed.view = number;
        }
      }
    });
  }
  Shards<Seed> layer;
  tbb::parallel_for(std::size_t{0}, kNumShards, [&](std::size_t s) {
    CheckStop(stop);
    layer[s] = FullestLayers(views, tables, s);
  });
  return layer;
}

/// Moves the seeds of one shard and drops those that too few views support. Sorted by the shard of
/// their new position.
Shards<Merged> MoveSeeds(std::span<const ViewSurface> views, const ViewFusion& fusion,
                         const std::vector<Seed>& seeds, const SurfaceCloudOptions& options,
                         float voxel_size, int min_views) {
  Shards<Merged> moved;
  std::vector<std::uint16_t> near;
  const float radius = 0.5F * std::sqrt(3.0F) * voxel_size * static_cast<float>(1 << kBlockBits);
  Key block = 0;
  for (std::size_t k = 0; k < seeds.size(); ++k) {
    const Seed& seed = seeds[k];
    const ViewSurface& view = views[seed.view];
    const Eigen::Vector3f p = PointInWorld(view, seed.pixel);
    const Eigen::Vector3f n =
        view.T_world_camera.linear().cast<float>() * view.normals[seed.pixel].Unit();
    if (k == 0 || BlockOf(seed.key) != block) {
      CheckStop(options.stop);
      block = BlockOf(seed.key);
      // Twice the radius: the ball about any point of the block covers the block.
      fusion.ViewsNear(p, 2.0F * radius, n, near);
    }
    const FusedPoint fused = fusion.Fuse(p, n, near);
    if (fused.num_agreeing < min_views || fused.num_through > fused.num_agreeing ||
        fused.weight <= 0.0F)
      continue;
    const Eigen::Vector3f point = p + fused.offset_m * n;
    Color color = {0, 0, 0};
    if (options.with_colors) color = views[fused.best_view.value()].ColorAt(fused.best_pixel);
    const Key key = KeyOf(point, 1.0F / voxel_size);
    moved[ShardOf(key)].push_back({key, point, fused.normal, fused.weight, color});
  }
  return moved;
}

/// Weighted mean of the moved seeds of each voxel.
PointCloud MergeVoxels(const std::array<Shards<Merged>, kNumShards>& moved, bool with_colors) {
  std::array<VoxelTable<Merged>, kNumShards> voxels;
  tbb::parallel_for(std::size_t{0}, kNumShards, [&](std::size_t s) {
    for (const Shards<Merged>& source : moved) {
      for (const Merged& point : source[s]) {
        auto [sum, is_new] = voxels[s].FindOrAdd(point);
        if (is_new) {
          sum.point *= point.weight;
          sum.normal *= point.weight;
          continue;
        }
        sum.point += point.weight * point.point;
        sum.normal += point.weight * point.normal;
        sum.weight += point.weight;
      }
    }
  });
  PointCloud cloud;
  std::size_t size = 0;
  for (const auto& shard : voxels) size += shard.entries().size();
  cloud.points.reserve(size);
  cloud.normals.reserve(size);
  if (with_colors) cloud.colors.reserve(size);
  for (const auto& shard : voxels) {
    for (const Merged& voxel : shard.entries()) {
      const float length = voxel.normal.norm();
      if (!(length > 0.0F)) continue;  // views from opposite sides do not form a surface
      cloud.points.push_back(voxel.point / voxel.weight);
      cloud.normals.push_back(voxel.normal / length);
      if (with_colors) cloud.colors.push_back(voxel.color);
    }
  }
  return cloud;
}

}  // namespace

PointCloud MergeSurface(std::span<const ViewSurface> views, const SurfaceCloudOptions& options) {
  if (!(options.voxel_size_m > 0.0F && options.voxel_size_m < 1.0F && options.min_views >= 1 &&
        options.band_m > 0.0F))
    throw std::invalid_argument("merged surface: voxel size, band or number of views out of range");
  if (views.empty()) return {};
  for (const ViewSurface& view : views)
    if (!IsFinite(view.T_world_camera) || view.T_world_camera.translation().norm() > kMaxDistance)
      throw std::invalid_argument(
          "merged surface: a view's pose is not finite or lies too far from the origin");
  const int min_views = std::min(options.min_views, static_cast<int>(views.size()));
  bool with_colors = options.with_colors;
  for (const ViewSurface& view : views) with_colors = with_colors && !view.color_rgb.empty();
  float voxel_size = options.voxel_size_m;
  Shards<Seed> seeds;
  for (;;) {
    seeds = FindSeeds(views, 1.0F / voxel_size, options.stop);
    std::size_t count = 0;
    for (const auto& shard : seeds) count += shard.size();
    if (count <= kMaxSeeds) break;
    voxel_size *= 1.5F;
  }
  const ViewFusion fusion(views, {.min_band_m = options.band_m});
  std::array<Shards<Merged>, kNumShards> moved;
  tbb::parallel_for(std::size_t{0}, kNumShards, [&](std::size_t s) {
    moved[s] = MoveSeeds(views, fusion, seeds[s], options, voxel_size, min_views);
  });
  CheckStop(options.stop);
  return MergeVoxels(moved, with_colors);
}

}  // namespace plumb
