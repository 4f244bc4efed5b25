// SPDX-License-Identifier: Apache-2.0
#include "algo/published/poisson_disk.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/geometry/grid_hash.hpp"

namespace plumb {
namespace {

constexpr std::size_t kFirstOneIn =
    16;  // one sixteenth of a depth image already yields nearly all points kept at 2 cm

/// Kept points by cell. A point is entered into every cell that its disk touches, so that a visit
/// checks one cell only; there are about a hundred visits per kept point.
class KeptPoints {
 public:
  static constexpr std::uint32_t kNobody = CellMap::kNone;

  KeptPoints(float spacing, std::size_t num_points)
      : spacing_(spacing), inverse_size_(1.0F / spacing) {
    first_.Reset(std::min<std::size_t>(num_points, 1U << 16));
  }

  /// @param blocker  A kept point to try first, or kNobody; receives the point that is too near.
  [[nodiscard]] bool IsFree(const Eigen::Vector3f& p, std::uint32_t& blocker) const {
    const float limit = spacing_ * spacing_;
    if (blocker != kNobody && (nodes_[blocker].point - p).squaredNorm() < limit) return false;
    for (std::uint32_t i = first_.Find(CellOf(p)); i != CellMap::kNone && i != kEnd;
         i = nodes_[i].next) {
      if ((nodes_[i].point - p).squaredNorm() < limit) {
        blocker = i;
        return false;
      }
    }
    return true;
  }

  void Add(const Eigen::Vector3f& p) {
    const Eigen::Vector3i centre(Index(p.x()), Index(p.y()), Index(p.z()));
    for (int dz = -1; dz <= 1; ++dz) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const Eigen::Vector3i cell = centre + Eigen::Vector3i(dx, dy, dz);
          std::uint32_t& head =
              first_.FindOrAdd(LatticeCell(cell.x(), cell.y(), cell.z()).key(), kEnd);
          nodes_.push_back({p, head});
          head = static_cast<std::uint32_t>(nodes_.size() - 1);
        }
      }
    }
  }

 private:
  static constexpr std::uint32_t kEnd = CellMap::kNone - 1;
  struct Node {
    Eigen::Vector3f point;
    std::uint32_t next;
  };

  [[nodiscard]] int Index(float coordinate) const {
    return LatticeCell::Index(coordinate, inverse_size_);
  }
  [[nodiscard]] std::uint64_t CellOf(const Eigen::Vector3f& p) const {
    return LatticeCell(Index(p.x()), Index(p.y()), Index(p.z())).key();
  }

  float spacing_;
  float inverse_size_;
  CellMap first_;
  std::vector<Node> nodes_;
};

}  // namespace

std::vector<std::uint32_t> PoissonDiskSubset(std::span<const Eigen::Vector3f> points,
                                             double spacing, unsigned seed) {
  if (!(spacing >= 0.0 && std::isfinite(spacing)))
    throw std::invalid_argument(
        fmt::format("Poisson-disk subset: spacing {} m is not a distance", spacing));
  const double reach =
      spacing > 0.0 ? spacing * (LatticeCell::kLimit - 2) : std::numeric_limits<double>::max();
  for (std::size_t i = 0; i < points.size(); ++i) {
    // Written so that NaN fails too.
    if (!(std::abs(points[i].x()) < reach && std::abs(points[i].y()) < reach &&
          std::abs(points[i].z()) < reach))
      throw std::invalid_argument(
          fmt::format("Poisson-disk subset: point {} is not finite or too far away", i));
  }
  if (spacing == 0.0) {
    std::vector<std::uint32_t> all(points.size());
    std::iota(all.begin(), all.end(), 0U);
    return all;
  }

  KeptPoints kept(static_cast<float>(spacing), points.size());
  std::vector<std::uint32_t> kept_indices;
  std::mt19937 random(seed);
  // Random draws are implemented here because the standard distributions and std::shuffle differ
  // between libraries.
  const auto draw = [&](std::size_t count) {
    return static_cast<std::uint32_t>((random() * static_cast<std::uint64_t>(count)) >> 32);
  };
  const auto visit = [&](std::uint32_t i) {
    std::uint32_t blocker = KeptPoints::kNobody;
    if (!kept.IsFree(points[i], blocker)) return;
    kept.Add(points[i]);
    kept_indices.push_back(i);
  };
  // A uniformly random order at low cost: it begins with draws with repetition (a repeated visit
  // changes nothing); then all points excluded by those kept so far are removed in memory order;
  // the rest is shuffled.
  for (std::size_t k = 0; k < points.size() / kFirstOneIn; ++k) visit(draw(points.size()));
  std::vector<std::uint32_t> free;
  std::uint32_t blocker = KeptPoints::kNobody;
  for (std::uint32_t i = 0; i < points.size(); ++i)
    if (kept.IsFree(points[i], blocker)) free.push_back(i);
  for (std::size_t k = 0; k < free.size(); ++k) {
    std::swap(free[k], free[k + draw(free.size() - k)]);
    visit(free[k]);
  }
  std::sort(kept_indices.begin(), kept_indices.end());
  return kept_indices;
}

}  // namespace plumb
