// Where the markers of a suite lie.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "algo/base/intrinsics.hpp"
#include "drivers/simulated/distance_grid.hpp"
#include "drivers/simulated/trajectory.hpp"
#include "drivers/simulated/world.hpp"

namespace plumb::simulated {

/// One scene as far as the markers are concerned: what they must not lie under, and from where they
/// are looked at.
struct LayoutScene {
  std::shared_ptr<const DistanceGrid> body;
  Pose T_world_body = Pose::Identity();
  SweepOptions sweep;
};

/// The rectangle around the origin that holds the boards' centres, metres, and how many boards lie
/// in it.
struct LayoutRegion {
  double half_length = 0.9;
  double half_width = 0.6;
  std::size_t num_boards = 24;
};

/// Lays boards around the bodies of all scenes, none under any of them, where a person would put
/// them: so that every part of every sweep sees several. The first board is the reference marker:
/// at the head, right of the body (-x, -y), its x axis along the sweep, seen in every scene.
/// @throws std::invalid_argument if no place for the reference marker is seen in all scenes.
[[nodiscard]] std::vector<Board> LayBoards(const LayoutRegion& region,
                                           const std::vector<LayoutScene>& scenes,
                                           const Intrinsics& camera, std::uint64_t seed);

}  // namespace plumb::simulated
