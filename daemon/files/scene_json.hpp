// scene.json: the small values of a scene.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "algo/types/height_map.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// The text of scene.json, which `reconstruct --json` also prints. Numbers are read back bit for
/// bit; the keys have a fixed order.
[[nodiscard]] std::string SceneJson(const Scene& scene);

/// The contents of scene.json: a scene without its poses, cloud, heights and mesh, and the sizes
/// that those must have.
struct SceneHeader {
  Scene scene;
  std::size_t num_keyframes = 0;
  std::optional<GridShape> grid;
};

/// Reads and checks scene.json of format 1.
/// @param name  Name of the file for messages.
/// @throws DataError naming file and key: a newer format, a missing key, a number that is not
///         finite or implausibly large.
[[nodiscard]] SceneHeader ParseSceneJson(std::string_view text, const std::string& name);

}  // namespace plumb
