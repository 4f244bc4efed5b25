// SPDX-License-Identifier: Apache-2.0
// The sweeps that a virtual sensor shows, rendered in advance into a cache on the disk.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>
#include <string_view>

#include "drivers/live/sensor_driver.hpp"
#include "drivers/simulator/player/rendered_scenes.hpp"
#include "drivers/simulator/suites/suite.hpp"

namespace plumb {

/// The suite that the virtual sensor plays, as `plumb simulate` renders it. @throws
/// std::invalid_argument for another image size.
[[nodiscard]] SimulateOptions ScenesOf(const VirtualSensorOptions& options);

/// $XDG_CACHE_HOME/plumb/virtual-sensor, otherwise ~/.cache/plumb/virtual-sensor, otherwise a
/// folder in the system's temporary folder.
[[nodiscard]] std::filesystem::path DefaultVirtualSensorCache();

/// Renders what is not in the cache yet. What the same program has rendered or checked before is
/// taken as it is.
/// @param progress  If set, called on the calling thread with the rendered fraction and the scene's
///         name.
/// @throws std::invalid_argument for an unknown suite or numbers out of range, IoError if the cache
///         cannot be used, Interrupted on a stop request.
[[nodiscard]] RenderedScenes RenderScenes(const VirtualSensorOptions& options,
                                          const std::stop_token& stop = {},
                                          const SetUpProgress& progress = {});

/// Removes the leading "ok" from the answer to a command. @throws DeviceError if it was refused.
[[nodiscard]] std::string AcceptedAnswer(std::string_view command, std::string answer);

}  // namespace plumb
