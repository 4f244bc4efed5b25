// Plans the scenes of a suite: bodies, placements, room and sweeps, drawn from a seed.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "algo/types/point_cloud.hpp"
#include "drivers/simulated/body.hpp"
#include "drivers/simulated/distance_grid.hpp"
#include "drivers/simulated/simulated_source.hpp"
#include "drivers/simulated/suite.hpp"

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
  std::vector<std::pair<std::string, std::string>> pairs;  ///< Reference scene, current scene.
};

[[nodiscard]] std::shared_ptr<const DistanceGrid> MakeGrid(const BodyShape& shape);
[[nodiscard]] std::shared_ptr<const BodyModel> MakeBody(const BodyShape& shape);

/// @throws std::invalid_argument for an unknown suite or numbers out of range.
[[nodiscard]] SuitePlan PlanSuite(const SimulateOptions& options);

/// The stream of one scene.
[[nodiscard]] std::unique_ptr<SimulatedSource> MakeSource(const SuitePlan& plan, std::size_t scene);

}  // namespace plumb::simulated
