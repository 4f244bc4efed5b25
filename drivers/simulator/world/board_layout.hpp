// SPDX-License-Identifier: Apache-2.0
// Places the markers of a suite.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "algo/base/intrinsics.hpp"
#include "drivers/simulator/world/distance_grid.hpp"
#include "drivers/simulator/world/trajectory.hpp"
#include "drivers/simulator/world/world.hpp"

namespace plumb::simulated {

/// One scene as far as markers are concerned: the area to keep free and the viewpoints.
struct LayoutScene {
  std::shared_ptr<const DistanceGrid> body;
  Pose T_world_body = Pose::Identity();
  SweepOptions sweep;
};

/// The rectangle around the origin for the boards' centres, metres, and the number of boards in it.
struct LayoutRegion {
  double half_length = 0.9;
  double half_width = 0.6;
  std::size_t num_boards = 24;
};

/// Places boards around the bodies of all scenes, with none under any of them, as a person would:
/// every part of every sweep sees several. The first board is the reference marker: at the head,
/// right of the body (-x, -y), with its x axis along the sweep, seen in every scene.
/// @throws std::invalid_argument if no place for the reference marker is seen in all scenes.
[[nodiscard]] std::vector<Board> LayBoards(const LayoutRegion& region,
                                           const std::vector<LayoutScene>& scenes,
                                           const Intrinsics& camera, std::uint64_t seed);

}  // namespace plumb::simulated
