// SPDX-License-Identifier: Apache-2.0
// scene.json: the small values of a scene.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "algo/types/height_map.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// SHA-256 in hexadecimal of each other file of the scene's folder, by name.
using SceneSums = std::map<std::string, std::string>;

/// The text of scene.json. Numbers are read back bit for bit; the keys have a fixed order.
[[nodiscard]] std::string SceneJson(const Scene& scene,
                                    const std::optional<SceneSums>& sums = std::nullopt);

/// What scene.json states of the large parts of its scene.
struct SceneShape {
  std::size_t num_keyframes = 0;
  std::optional<GridShape> grid;  ///< Of the height map.
};

/// The contents of scene.json: a scene without its poses, cloud, heights and mesh.
struct StoredScene {
  Scene scene;
  SceneShape shape;
  std::optional<SceneSums> sums = {};  ///< Absent before version 0.3.
};

/// Reads and checks scene.json of format 1.
/// @param name  Name of the file for messages.
/// @throws DataError naming file and key: a newer format, a missing key, a number that is not
///         finite or implausibly large.
[[nodiscard]] StoredScene ParseSceneJson(std::string_view text, const std::string& name);

}  // namespace plumb
