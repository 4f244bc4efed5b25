// SPDX-License-Identifier: Apache-2.0
// The true values of a recorded scene, from the files that a simulator writes beside its recording.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// The true surface of the body at this scene's placement.
struct TrueSurface {
  std::vector<Eigen::Vector3d> vertices_world;  ///< Metres.
  std::vector<float> frames_seen;  ///< For each vertex the number of frames that measured it.
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// All true values of one scene. `world` is the simulator's own frame, shared by all scenes of a
/// suite.
struct SceneTruth {
  std::vector<StampedPose> trajectory;   ///< Of the colour camera, increasing in time.
  std::map<int, MarkerCorners> markers;  ///< World, detector order, by id.
  Pose T_world_body = Pose::Identity();  ///< Placement of the body.
  Pose T_world_reference_marker = Pose::Identity();
  Eigen::Vector3d centroid_body =
      Eigen::Vector3d::Zero();  ///< Area centroid of the body, in its own frame.
  TrueSurface body;
  double breathing_m = 0.0;  ///< Rise of chest and belly during the sweep; 0 where not stated.

  [[nodiscard]] Eigen::Vector3d centroid_world() const { return T_world_body * centroid_body; }
};

/// Reads `groundtruth.txt`, `markers.json`, `motion.json` and `body.ply` of one truth folder.
/// @throws DataError naming the file and what is wrong with it.
[[nodiscard]] SceneTruth ReadSceneTruth(const std::filesystem::path& folder);

/// The true camera pose at a time, interpolated between its neighbours; nothing outside the
/// recorded time or where the neighbours are more than 0.1 s apart.
[[nodiscard]] std::optional<Pose> TruePoseAt(std::span<const StampedPose> trajectory,
                                             double time_s);

}  // namespace plumb
