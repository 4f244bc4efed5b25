// scene.json: the small facts of a scene.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "algo/types/height_map.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// The text of scene.json, also what `reconstruct --json` prints. Numbers read back bit for bit;
/// keys in a fixed order.
[[nodiscard]] std::string SceneJson(const Scene& scene);

/// The contents of scene.json: a scene without its poses, cloud, heights and mesh, and how many or
/// large those must be.
struct SceneHeader {
  Scene scene;
  std::size_t num_keyframes = 0;
  std::optional<GridShape> grid;
};

/// Reads and checks scene.json of format 1.
/// @param name  Of the file, for messages.
/// @throws DataError naming file and key: a newer format, a missing key, a number that is not
/// finite or absurdly large.
[[nodiscard]] SceneHeader ParseSceneJson(std::string_view text, const std::string& name);

}  // namespace plumb
