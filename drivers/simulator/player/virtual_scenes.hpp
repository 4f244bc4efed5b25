// SPDX-License-Identifier: Apache-2.0
// The sweeps that a virtual sensor shows, rendered in advance into a cache on the disk.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "algo/types/frame.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/simulator/sensor/sensor_unit.hpp"
#include "drivers/simulator/suites/suite.hpp"

namespace plumb {

struct VirtualSensorOptions : SimulatedSweeps {
  simulated::NoiseLevel noise = simulated::NoiseLevel::kNominal;
  double rate_hz = 30.0;  ///< A sweep lasts frames / rate_hz.
  std::filesystem::path cache_folder =
      {};  ///< Cache of the rendered frames, 1.5 MB each; empty: DefaultVirtualSensorCache().
  std::string serial = "VIRTUAL-0001";  ///< Serial of the unit that exists at the start.
  /// Library of the private driver tree if OpenNI2 shows the sensor; empty: the one installed with
  /// the program, see FindVirtualSensorRuntime().
  std::filesystem::path runtime = {};
};

/// The suite that the virtual sensor plays, as `plumb simulate` renders it. @throws
/// std::invalid_argument for another image size.
[[nodiscard]] SimulateOptions ScenesOf(const VirtualSensorOptions& options);

/// $XDG_CACHE_HOME/plumb/virtual-sensor, otherwise ~/.cache/plumb/virtual-sensor, otherwise a
/// folder in the system's temporary folder.
[[nodiscard]] std::filesystem::path DefaultVirtualSensorCache();

/// The rendered scenes of a suite.
struct RenderedScenes {
  std::vector<std::string> names;                   ///< In the order in which they are shown.
  std::vector<std::filesystem::path> caches;        ///< Files as frame_cache.hpp describes them.
  std::vector<std::filesystem::path> at_rest = {};  ///< Caches of the loops, if they were wanted.
  std::vector<std::filesystem::path> second_at_rest = {};  ///< Those of the second unit.
  StreamInfo camera;                                       ///< Camera of the unit that shows them.
  StreamInfo second_camera;                                ///< Of the second unit, if there is one.
};

/// Renders what is not in the cache yet.
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
