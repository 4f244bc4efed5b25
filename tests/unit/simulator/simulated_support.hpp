// SPDX-License-Identifier: Apache-2.0
// Small worlds with an analytic truth.
#pragma once

#include <memory>
#include <vector>

#include "drivers/simulator/world/world.hpp"

namespace plumb::simulated {

inline constexpr double kBallRadius = 0.10;

inline std::shared_ptr<const DistanceGrid> Ball() {
  const Eigen::AlignedBox3d box(Eigen::Vector3d::Constant(-kBallRadius - 0.03),
                                Eigen::Vector3d::Constant(kBallRadius + 0.03));
  return std::make_shared<const DistanceGrid>(
      [](const Eigen::Vector3d& p) { return p.norm() - kBallRadius; }, box, 0.005);
}

/// A ball with its centre at the given place over a uniformly grey floor, and boards.
inline World BallWorld(const Eigen::Vector3d& centre, const std::vector<Board>& boards = {}) {
  Room room;
  room.boards = boards;
  room.support_texture = std::make_shared<const Texture>(Eigen::Vector2f(-1, -1), 0.05F, 40, 40,
                                                         Eigen::Vector3f::Constant(0.3F));
  room.skin_texture = room.support_texture;
  Pose T_world_body = Pose::Identity();
  T_world_body.translation() = centre;
  return World(room, Ball(), T_world_body);
}

/// A sensor held still over the origin of the support, looking straight down.
inline SweepOptions Standing(double height_m) {
  SweepOptions sweep;
  sweep.half_way_m = 0.0;
  sweep.swing_m = 0.0;
  sweep.height_m = height_m;
  sweep.tremor = 0.0;
  return sweep;
}

}  // namespace plumb::simulated
