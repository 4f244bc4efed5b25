// SPDX-License-Identifier: Apache-2.0
// SCENE folders, which `plumb reconstruct` writes and `plumb compare` reads.
#pragma once

#include <filesystem>
#include <stop_token>

#include "algo/types/scene.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/files/stored_scene.hpp"

namespace plumb {

/// scene.json, trajectory.txt, trajectory_all.txt, cloud.ply, heightmap.tiff, mesh.ply,
/// sensitivity.json.
[[nodiscard]] OutputKind SceneOutput();

/// Writes a scene, completely or not at all, and replaces an older scene at that place. The files
/// of the height map and the mesh exist only if the scene has them. The same scene gives the same
/// bytes.
/// @param stop  Polled between the files.
/// @throws IoError; Interrupted; std::invalid_argument if the scene contradicts itself (attribute
///         counts) or contains poses or corners that are not finite.
void WriteScene(const Scene& scene, const std::filesystem::path& folder,
                const std::stop_token& stop = {});

/// The large parts to read; scene.json and the trajectories are always read.
struct SceneParts {
  bool cloud = true;
  bool height_map = true;
  bool mesh = false;  ///< Stays empty if the scene has none.
};

/// Reads a scene and checks all of its contents.
/// @throws DataError naming the file, what was found and what is expected: another format, missing
///         or truncated files, numbers that are not finite, inconsistent sizes, a file that is not
///         the one with which the scene was written.
[[nodiscard]] Scene ReadScene(const std::filesystem::path& folder, const SceneParts& parts = {});

/// scene.json as it is. @throws IoError
[[nodiscard]] std::string SceneText(const std::filesystem::path& folder);

/// The small values of a scene; nothing else is read. @throws DataError as ReadScene(); IoError
[[nodiscard]] StoredScene ReadStoredScene(const std::filesystem::path& folder);

/// True if the folder looks like a scene: it contains scene.json.
[[nodiscard]] bool IsSceneFolder(const std::filesystem::path& folder);

}  // namespace plumb
