// SPDX-License-Identifier: Apache-2.0
// What a virtual sensor is to show, and the files of it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "drivers/live/sensor_driver.hpp"
#include "drivers/simulator/sensor/sensor_unit.hpp"

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

/// The rendered scenes of a suite.
struct RenderedScenes {
  std::vector<std::string> names;                   ///< In the order in which they are shown.
  std::vector<std::filesystem::path> caches;        ///< Files as frame_cache.hpp describes them.
  std::vector<std::filesystem::path> at_rest = {};  ///< Caches of the loops, if they were wanted.
  std::vector<std::filesystem::path> second_at_rest = {};  ///< Those of the second unit.
  /// camera.yaml of the unit that shows them, as CameraFileText() writes it, and of the second one.
  std::string camera_file, second_camera_file;
};

}  // namespace plumb
