// SCENE folders: what `plumb reconstruct` leaves and `plumb compare` reads.
#pragma once

#include <filesystem>
#include <stop_token>

#include "algo/types/scene.hpp"
#include "daemon/files/atomic_folder.hpp"

namespace plumb {

/// scene.json, trajectory.txt, trajectory_all.txt, cloud.ply, heightmap.tiff, mesh.ply.
[[nodiscard]] OutputKind SceneOutput();

/// Writes a scene, whole or not at all; replaces an older scene at that place. The height map's and
/// the mesh's files are there only where the scene has them. Same scene, same bytes.
/// @param stop  Polled between the files.
/// @throws IoError; Interrupted; std::invalid_argument if the scene contradicts itself (attribute
/// counts) or holds poses or corners that are not finite.
void WriteScene(const Scene& scene, const std::filesystem::path& folder,
                const std::stop_token& stop = {});

/// Which of the large parts to read; scene.json and the trajectories always are.
struct SceneParts {
  bool cloud = true;
  bool height_map = true;
  bool mesh = false;  ///< Stays empty where the scene has none.
};

/// Reads a scene and checks everything that it holds.
/// @throws DataError naming the file, what was found and what is expected: another format, missing
/// or truncated files, numbers
///         that are not finite, sizes that disagree.
[[nodiscard]] Scene ReadScene(const std::filesystem::path& folder, const SceneParts& parts = {});

/// True if the folder looks like one: it holds scene.json.
[[nodiscard]] bool IsSceneFolder(const std::filesystem::path& folder);

}  // namespace plumb
