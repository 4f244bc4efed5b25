// SPDX-License-Identifier: Apache-2.0
// Writes the true values beside a simulated recording.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "drivers/simulator/suites/planned_scenes.hpp"

namespace plumb::simulated {

/// Counts the frames in which each vertex of the body was measured.
class VertexSightings {
 public:
  VertexSightings(const SuitePlan& plan, std::size_t scene);
  void Add(const FrameTruth& truth);
  [[nodiscard]] const std::vector<int>& counts() const { return counts_; }

 private:
  const SuitePlan& plan_;
  const ScenePlan& scene_;
  std::vector<Eigen::Vector3d> vertices_in_world_;
  std::vector<Eigen::Vector3d> normals_in_world_;
  std::vector<int> counts_;
};

/// Writes groundtruth.txt (500 Hz, colour camera to world), markers.json, motion.json and body.ply
/// (world frame) into an existing folder.
/// @throws IoError
void WriteTruth(const std::filesystem::path& folder, const SuitePlan& plan, std::size_t scene,
                const SimulatedSource& source, const std::vector<int>& vertex_sightings);

/// The same for a planning CT, without a trajectory.
/// @throws IoError
void WriteTruth(const std::filesystem::path& folder, const SuitePlan& plan, const CtPlan& ct);

/// Writes the room of the suite `ct`: room.toml with T_iec_reference, and room/scene.json with the
/// true markers in the frame of the reference marker, as the taught ones.
/// @throws IoError
void WriteRoom(const std::filesystem::path& suite, const SuitePlan& plan);

/// Height of the belly's highest point above that of the exhaled body, in the body's own frame.
[[nodiscard]] double BellyHeight(const LiveScript& script, double time_s);

/// One line of live.csv: the body before a sensor at rest, at the depth image's time.
class LiveTruth {
 public:
  explicit LiveTruth(const ScenePlan& scene);
  void Add(const FrameTruth& truth);
  /// Writes live.csv, and of what moves in it live.json. @throws IoError
  void Write(const std::filesystem::path& folder, const SuitePlan& plan) const;

 private:
  const ScenePlan& scene_;
  std::string text_;
};

/// Writes the true values of the sensor: its optics, depth errors, times and tone curve.
/// @throws IoError
void WriteUnit(const std::filesystem::path& file, const SensorUnit& unit);

}  // namespace plumb::simulated
