// SPDX-License-Identifier: Apache-2.0
// The scenes of a suite: bodies, placements, room and sweeps.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "algo/types/point_cloud.hpp"
#include "drivers/simulator/sensor/simulated_source.hpp"
#include "drivers/simulator/suites/planning_ct.hpp"
#include "drivers/simulator/world/body.hpp"
#include "drivers/simulator/world/distance_grid.hpp"

namespace plumb::simulated {

/// A body ready for rendering: its distances, its surface, and the area centroid of that surface
/// (body frame).
struct BodyModel {
  BodyShape shape;
  std::shared_ptr<const DistanceGrid> grid;
  TriangleMesh surface;
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
};

struct ScenePlan {
  std::string name;
  std::shared_ptr<const BodyModel> body;
  Pose T_world_body = Pose::Identity();
  SimulatedSweep sweep;
  std::vector<Board> boards = {};  ///< Boards of the room as they lie at the start of the sweep.
  std::shared_ptr<const SensorUnit> other_unit = {};  ///< Null: the suite's.
};

/// A planning CT of the body, instead of a sweep.
struct CtPlan {
  std::string name;
  std::shared_ptr<const BodyModel> body;
  Pose T_world_body = Pose::Identity();  ///< As it should lie in the treatment room.
  PlanningCtOptions options;
};

/// World frame of all scenes: z up from the supporting plane, x from head to feet, origin in the
/// middle of the placements.
struct SuitePlan {
  std::string name;
  SensorUnit unit;
  Room room;
  int reference_marker =
      0;  ///< At the head, right of the body (-x, -y), with its x axis along the sweep.
  std::vector<ScenePlan> scenes;
  std::vector<CtPlan> cts = {};                            ///< References of the suite `ct`.
  Pose T_iec_world = Pose::Identity();                     ///< Axes of the room of the suite `ct`.
  std::vector<std::pair<std::string, std::string>> pairs;  ///< Reference scene, current scene.
  /// The scenes from here on are recordings of a sensor at rest, over the body of the one before.
  std::size_t num_sweeps = SIZE_MAX;
  /// Names of recordings of the same time by two sensors at rest.
  std::map<std::string, std::vector<std::string>> live_together = {};
};

[[nodiscard]] std::shared_ptr<const DistanceGrid> MakeGrid(const BodyShape& shape);
[[nodiscard]] std::shared_ptr<const BodyModel> MakeBody(const BodyShape& shape);

}  // namespace plumb::simulated
