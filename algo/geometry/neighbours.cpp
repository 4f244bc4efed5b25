// SPDX-License-Identifier: Apache-2.0
#include "algo/geometry/neighbours.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace plumb {
namespace {

// Distances are compared in single precision, so searches extend slightly beyond the exact bound.
// Relative and absolute margins.
constexpr float kReachFactor = 1.0F + 1e-5F;
constexpr float kReachMargin = 1e-6F;
// number of moves of the last size for which an answer should stay valid
constexpr float kStepsAhead = 8.0F;

}  // namespace

CloudNeighbours::CloudNeighbours(Clouds clouds, double cell_size)
    : inverse_size_(static_cast<float>(1.0 / cell_size)),
      cell_size_(static_cast<float>(cell_size)),
      slack_(0.25F * cell_size_) {
  if (!(cell_size > 0.0 && std::isfinite(cell_size)))
    throw std::invalid_argument(
        fmt::format("neighbours: cell size {} m is not a length", cell_size));
  starts_.push_back(0);
  for (const auto& cloud : clouds)
    starts_.push_back(starts_.back() + static_cast<std::uint32_t>(cloud.size()));
  points_.resize(starts_.back());
  entries_.resize(points_.size());
  entry_of_.resize(points_.size());
  const float reach = cell_size_ * static_cast<float>(LatticeCell::kLimit / 2);
  for (std::size_t c = 0; c < clouds.size(); ++c) {
    for (std::size_t i = 0; i < clouds[c].size(); ++i) {
      if (!(clouds[c][i].cwiseAbs().maxCoeff() < reach) || !clouds[c][i].allFinite())
        throw std::invalid_argument(
            fmt::format("neighbours: point {} of cloud {} is not finite or too far away", i, c));
      points_[starts_[c] + i] = clouds[c][i];
    }
  }
  Bin();
}

void CloudNeighbours::Move(Clouds clouds) {
  if (clouds.size() + 1 != starts_.size())
    throw std::invalid_argument("neighbours: the number of clouds has changed");
  const float reach = cell_size_ * static_cast<float>(LatticeCell::kLimit / 2);
  float largest = 0.0F;
  for (std::size_t c = 0; c < clouds.size(); ++c) {
    if (clouds[c].size() != starts_[c + 1] - starts_[c])
      throw std::invalid_argument("neighbours: the number of points has changed");
    for (std::size_t i = 0; i < clouds[c].size(); ++i) {
      Eigen::Vector3f& point = points_[starts_[c] + i];
      const Eigen::Vector3f& moved = clouds[c][i];
      if (!(moved.cwiseAbs().maxCoeff() < reach) || !moved.allFinite())
        throw std::invalid_argument(
            fmt::format("neighbours: point {} of cloud {} is not finite or too far away", i, c));
      largest = std::max(largest, (moved - point).squaredNorm());
      point = moved;
    }
  }
  last_step_ = std::sqrt(largest) * kReachFactor;
  travel_ += last_step_;
  if (travel_ - travel_when_binned_ > slack_) {
    Bin();
    return;
  }
  for (std::size_t i = 0; i < points_.size(); ++i) entries_[entry_of_[i]].point = points_[i];
}

void CloudNeighbours::Bin() {
  travel_when_binned_ = travel_;
  cell_of_.Reset(points_.size());
  cells_.clear();
  std::vector<std::uint32_t> cell_of_point(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector3f& p = points_[i];
    const LatticeCell cell(LatticeCell::Index(p.x(), inverse_size_),
                           LatticeCell::Index(p.y(), inverse_size_),
                           LatticeCell::Index(p.z(), inverse_size_));
    const std::uint32_t index =
        cell_of_.FindOrAdd(cell.key(), static_cast<std::uint32_t>(cells_.size()));
    if (index == cells_.size()) cells_.emplace_back();
    ++cells_[index].last;
    cell_of_point[i] = index;
  }
  std::uint32_t start = 0;
  for (Range& cell : cells_) {
    cell.first = start;
    start += cell.last;
    cell.last = cell.first;
  }
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const std::uint32_t at = cells_[cell_of_point[i]].last++;
    entries_[at] = {points_[i], static_cast<std::uint32_t>(i)};
    entry_of_[i] = at;
  }
}

void CloudNeighbours::SearchBox(const Eigen::Vector3f& p, float reach, std::uint32_t own_first,
                                std::uint32_t own_last, Best& best) const {
  const float slack = travel_ - travel_when_binned_ + kReachMargin;
  const float out = reach + slack;
  const Eigen::Vector3i lo(LatticeCell::Index(p.x() - out, inverse_size_),
                           LatticeCell::Index(p.y() - out, inverse_size_),
                           LatticeCell::Index(p.z() - out, inverse_size_));
  const Eigen::Vector3i hi(LatticeCell::Index(p.x() + out, inverse_size_),
                           LatticeCell::Index(p.y() + out, inverse_size_),
                           LatticeCell::Index(p.z() + out, inverse_size_));
  // Squared distance along one axis to the possible contents of a slab of cells, including the
  // drift of points since binning. Rounding of the slab's borders is below a millionth of the
  // coordinate.
  const auto squared_gap = [&](float coordinate, int index) {
    const float low = static_cast<float>(index) * cell_size_;
    const float gap = std::max(low - coordinate, coordinate - low - cell_size_) - slack -
                      1e-6F * std::abs(coordinate);
    return gap > 0.0F ? gap * gap : 0.0F;
  };
  for (int x = lo.x(); x <= hi.x(); ++x) {
    const float gap_x = squared_gap(p.x(), x);
    for (int y = lo.y(); y <= hi.y(); ++y) {
      const float gap_xy = gap_x + squared_gap(p.y(), y);
      if (gap_xy > best.second_squared * kReachFactor) continue;
      for (int z = lo.z(); z <= hi.z(); ++z) {
        if (gap_xy + squared_gap(p.z(), z) > best.second_squared * kReachFactor) continue;
        const std::uint32_t cell = cell_of_.Find(LatticeCell(x, y, z).key());
        if (cell == CellMap::kNone) continue;
        for (std::uint32_t i = cells_[cell].first; i < cells_[cell].last; ++i) {
          const Entry& entry = entries_[i];
          if (entry.global_index >= own_first && entry.global_index < own_last) continue;
          if (entry.global_index == best.global_index) continue;
          const float squared = (entry.point - p).squaredNorm();
          if (squared < best.squared_distance ||
              (squared == best.squared_distance && entry.global_index < best.global_index))
            best = {squared, entry.global_index,
                    std::min(best.squared_distance, best.second_squared)};
          else if (squared < best.second_squared)
            best.second_squared = squared;
        }
      }
    }
  }
}

std::uint32_t CloudNeighbours::Nearest(std::size_t cloud, std::size_t index, float radius,
                                       Memory& memory) const {
  const std::uint32_t own_first = starts_[cloud];
  const std::uint32_t own_last = starts_[cloud + 1];
  const Eigen::Vector3f& p = points_[own_first + index];
  const float squared_radius = radius * radius;
  const auto reach_of = [](float distance) { return distance * kReachFactor + kReachMargin; };

  // Since the last search, two points may have approached each other by the travel of both.
  const float nearer_by = 2.0F * (travel_ - memory.travel_then);
  if (memory.none_within - nearer_by > reach_of(radius)) return kNone;

  // One cell beyond the radius, so that the next searches can know that nothing is near.
  const float farthest = radius + cell_size_;
  Best best = {farthest * farthest, kNone, farthest * farthest};
  float reach = std::min(cell_size_, farthest);
  if (memory.neighbour != kNone) {
    const float squared = (points_[memory.neighbour] - p).squaredNorm();
    const float distance = std::sqrt(squared);
    if (reach_of(distance) < memory.no_other_within - nearer_by)
      return squared < squared_radius ? memory.neighbour : kNone;
    // The old partner bounds the search. It extends slightly farther, because the next candidate
    // decides how long the answer stays valid.
    if (squared < best.squared_distance) {
      reach = std::min(
          distance + std::clamp(kStepsAhead * last_step_, 0.02F * cell_size_, 0.2F * cell_size_),
          farthest);
      best = {squared, memory.neighbour, reach * reach};
    }
  }
  for (;; reach = std::min(2.0F * reach, farthest)) {
    best.second_squared = std::min(best.second_squared, reach * reach);
    SearchBox(p, reach_of(reach), own_first, own_last, best);
    if (best.squared_distance <= reach * reach || reach >= farthest) break;
    best.second_squared = farthest * farthest;
  }
  memory = {best.global_index, std::sqrt(best.squared_distance), std::sqrt(best.second_squared),
            travel_};
  return best.squared_distance < squared_radius ? best.global_index : kNone;
}

}  // namespace plumb
