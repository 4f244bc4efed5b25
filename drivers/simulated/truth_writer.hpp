// Writes the true values beside a simulated recording.
#pragma once

#include <filesystem>
#include <vector>

#include "drivers/simulated/suite_plan.hpp"

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

/// Writes the true values of the sensor: its optics, depth errors, times and tone curve.
/// @throws IoError
void WriteUnit(const std::filesystem::path& file, const SensorUnit& unit);

}  // namespace plumb::simulated
