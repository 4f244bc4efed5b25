// SPDX-License-Identifier: Apache-2.0
// What this program has found out about the rendered scenes of the same options before. Planning a
// suite and rendering its first frames takes a second and more of processor time each.
#pragma once

#include <filesystem>
#include <optional>

#include "drivers/simulator/player/rendered_scenes.hpp"

namespace plumb::simulated {

/// The scenes as they were kept in the folder of rendered frames, if the same executable file kept
/// them for the same options, and no file of frames was written, replaced or removed since. Nothing
/// otherwise, or if what was kept cannot be read.
[[nodiscard]] std::optional<RenderedScenes> ReadKeptScenes(const std::filesystem::path& folder,
                                                           const VirtualSensorOptions& options);

/// Keeps them for the next start of this program. Does nothing if the disk refuses: they are then
/// found out again.
void KeepScenes(const std::filesystem::path& folder, const VirtualSensorOptions& options,
                const RenderedScenes& scenes) noexcept;

}  // namespace plumb::simulated
