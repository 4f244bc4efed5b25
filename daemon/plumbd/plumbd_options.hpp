// SPDX-License-Identifier: Apache-2.0
// The command line of plumbd and the configuration that it leads to.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <CLI/App.hpp>

#include "algo/base/message.hpp"
#include "daemon/config/config.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "web/model/scan.hpp"
#include "web/model/settings.hpp"

namespace plumb {

/// The command line of plumbd.
struct PlumbdOptions {
  std::optional<std::filesystem::path> config_file;
  bool use_default_config = true;  ///< If it exists and no file is named.
  bool check_config = false, show_folders = false, show_stopped = false;
  std::string simulated;  ///< Name of the suite; empty: real sensors.
  std::optional<std::filesystem::path> state, control, provision, recover;
  std::filesystem::path unit = "/data/unit";  ///< Where an image stores its provisioning data.
  std::optional<std::string> listen;
  int sim_frames = 300, sim_scenes = 0;
  unsigned sim_seed = 1;
  std::optional<unsigned> sim_room;
  std::string sim_size = "640x480";
  bool sim_unplugged = false, sim_board = false, sim_rest = false, sim_couch = false;
  double sim_result_s = kResultValid_s;
};

void AddPlumbdOptions(CLI::App& app, PlumbdOptions& options);

/// The file to read; nothing: the defaults.
[[nodiscard]] std::optional<std::filesystem::path> ConfigFile(const PlumbdOptions& options);

/// The configuration from file and command line.
/// @throws DataError for a file that cannot be used, std::invalid_argument for an option.
[[nodiscard]] Config ReadConfiguration(const PlumbdOptions& options,
                                       const SensorRegistry& registry);

/// The settings of a new store: the defaults, but for what the file gives.
[[nodiscard]] Settings FirstSettings(const ApplianceConfig& given);

/// The configuration in use, and why the requested one cannot be used.
struct Configured {
  Config config;
  Message fault;
  /// The file that cannot be used names a key for backups, or may do so.
  bool may_name_backup_key = false;
};

/// As ReadConfiguration(). If the file cannot be used, the program still starts: page, light and
/// socket report the error. Page, light and button are where the file says, as far as it can be
/// read; everything else is where the defaults and the command line say.
[[nodiscard]] Configured ReadOrExplain(const PlumbdOptions& options,
                                       const SensorRegistry& registry);

}  // namespace plumb
