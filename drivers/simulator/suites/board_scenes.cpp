// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/board_scenes.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "algo/base/units.hpp"

namespace plumb::simulated {
namespace {

constexpr double kTurn = 12 * kDegree;
constexpr double kAboveSupport_m = 2 * kMillimetre;
constexpr double kFarBelow_m = 3.0;        // depth at which the support hides a body
constexpr double kBoardDiagonal_m = 0.19;  // diagonal of one marker with its white margin
constexpr std::uint64_t kOtherNoise = 7919;

}  // namespace

/// The head points to the gantry, and the world's x axis from head to feet.
Pose CalibrationBoardPose() {
  Pose T_world_board = Pose::Identity();
  T_world_board.linear() << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  T_world_board.rotate(Eigen::AngleAxisd(kTurn, Eigen::Vector3d::UnitZ()));
  T_world_board.translation() = Eigen::Vector3d(0.04, -0.03, kAboveSupport_m);
  return T_world_board;
}

void AddBoardScenes(SuitePlan& plan, const std::map<int, Eigen::Vector2d>& centres_m,
                    int num_scenes) {
  ScenePlan scene = plan.scenes.front();
  scene.T_world_body.translation().z() -= kFarBelow_m;
  std::vector<Board> board;
  for (const auto& [id, centre_m] : centres_m) {
    Board marker;
    marker.id = id;
    marker.T_world_marker = CalibrationBoardPose();
    marker.T_world_marker.translate(Eigen::Vector3d(centre_m.x(), centre_m.y(), 0));
    board.push_back(marker);
  }
  const auto in_the_way = [&](const Board& other) {
    return std::any_of(board.begin(), board.end(), [&](const Board& marker) {
      return other.id == marker.id ||
             (other.T_world_marker.translation() - marker.T_world_marker.translation()).norm() <
                 kBoardDiagonal_m;
    });
  };
  std::erase_if(scene.boards, in_the_way);
  if (scene.boards.empty() || scene.boards.front().id != plan.reference_marker) {
    throw std::invalid_argument(
        fmt::format("the board of the room's calibration cannot lie in this simulated room: its "
                    "reference marker {} is in the way; expected another seed",
                    plan.reference_marker));
  }
  scene.boards.insert(scene.boards.end(), board.begin(), board.end());
  std::vector<ScenePlan> scenes;
  for (int i = 0; i < num_scenes; ++i) {
    scene.name = fmt::format("board-{}", i + 1);
    scene.sweep.seed += kOtherNoise;
    scene.sweep.motion.seed += kOtherNoise;
    scenes.push_back(scene);
  }
  plan.scenes.insert(plan.scenes.begin(), scenes.begin(), scenes.end());
}

}  // namespace plumb::simulated
