// SPDX-License-Identifier: Apache-2.0
// Finds nearest points among several moving clouds with one shared spatial hash.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "algo/geometry/grid_hash.hpp"

namespace plumb {

/// Finds, for a point of one cloud, the nearest point of any OTHER cloud. Exact for any hints.
///
/// Repeated searches are fast while the clouds move little between them, for two reasons. Points
/// stay in the cell where they were binned until one has moved by a quarter of a cell, and searches
/// extend by that distance. The result of the last search also stays valid for a while: its partner
/// is still the nearest, or there is none, until the clouds have moved by the distance to the next
/// candidate. After that the old partner bounds the search.
///
/// Nearest() is const and thread-safe for different points; Move() is not. Deterministic: among
/// equally near points the one with the smaller (cloud, index) is found.
class CloudNeighbours {
 public:
  using Clouds = std::span<const std::vector<Eigen::Vector3f>>;

  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  /// A point's last search; starts empty.
  struct Memory {
    std::uint32_t neighbour =
        kNone;  ///< Global index of the nearest point of the last search, within the radius or not.
    /// In the last search no point was nearer than this.
    float none_within = 0.0F;
    /// In the last search no point except `neighbour` was nearer than this.
    float no_other_within = 0.0F;
    /// How far the clouds had travelled at the last search.
    float travel_then = 0.0F;
  };

  /// @param cell_size  Metres, > 0; about the distance between neighbours within a cloud.
  /// @throws std::invalid_argument for a bad cell size, or points that are not finite or are a
  ///         million cells away.
  CloudNeighbours(Clouds clouds, double cell_size);

  /// The same points at new positions.
  /// @throws std::invalid_argument if the numbers of points differ, and as the constructor.
  void Move(Clouds clouds);

  /// Nearest point of another cloud with distance < radius.
  /// @return its global index or kNone; `memory` is used and updated.
  [[nodiscard]] std::uint32_t Nearest(std::size_t cloud, std::size_t index, float radius,
                                      Memory& memory) const;

  /// Position of a point by its global index (clouds in order).
  [[nodiscard]] const Eigen::Vector3f& point(std::uint32_t global_index) const {
    return points_[global_index];
  }

 private:
  struct Entry {
    Eigen::Vector3f point;
    std::uint32_t global_index;
  };
  struct Range {
    std::uint32_t first = 0;
    std::uint32_t last = 0;
  };
  struct Best {
    float squared_distance;
    std::uint32_t global_index;
    float second_squared;  ///< No other point was found nearer than this.
  };

  void Bin();
  void SearchBox(const Eigen::Vector3f& p, float reach, std::uint32_t own_first,
                 std::uint32_t own_last, Best& best) const;

  float inverse_size_;
  float cell_size_;
  float slack_;          ///< Upper bound of the distance of any point from where it was binned.
  float travel_ = 0.0F;  ///< Sum over all moves of the largest displacement.
  float travel_when_binned_ = 0.0F;
  float last_step_ = 0.0F;               ///< Largest displacement of the last move.
  std::vector<std::uint32_t> starts_;    ///< First global index of each cloud, then the total.
  std::vector<Eigen::Vector3f> points_;  ///< By global index.
  std::vector<std::uint32_t> entry_of_;  ///< By global index.
  std::vector<Entry> entries_;           ///< By cell.
  std::vector<Range> cells_;
  CellMap cell_of_;
};

}  // namespace plumb
