// SPDX-License-Identifier: Apache-2.0
#include "daemon/plumbd/plumbd_options.hpp"

#include <exception>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/notice.hpp"
#include "algo/base/pose.hpp"
#include "daemon/config/version.hpp"
#include "daemon/unit/page_identity.hpp"
#include "drivers/files/file_io.hpp"
#include "words/control.hpp"
#include "words/upkeep.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr const char* kDefaultConfig = "/etc/plumb/plumb.toml";

/// The simulated room: the reference marker's x axis runs from the head to the feet of a body that
/// lies on its back, its z axis is up, and the head points to the gantry.
Pose SimulatedRoom() {
  Pose T_iec_reference = Pose::Identity();
  T_iec_reference.linear() << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  return T_iec_reference;
}

/// Looks for the names line by line, because the file may not be valid TOML. A file that
/// cannot be read may contain it.
bool MayNameBackupKey(const fs::path& file) try {
  constexpr std::size_t kMaxEnvironmentBytes = 1 << 20;
  std::istringstream lines(ReadTextFile(file, kMaxEnvironmentBytes));
  for (std::string line; std::getline(lines, line);) {
    const bool is_comment = line.find_first_not_of(" \t") == line.find('#');
    for (const char* key : {"backup_key_file", "backup_recipients"})
      if (!is_comment && line.find(key) != std::string::npos) return true;
  }
  return false;
} catch (const std::exception&) {
  return true;
}

/// @param is_listen_given  On the command line, which overrides the file.
void KeepPanelAndPage(const Config& salvaged, bool is_listen_given, Config& config) {
  config.panel = salvaged.panel;
  WebConfig web = salvaged.web;
  if (is_listen_given) web.listen = config.web.listen;
  try {
    CheckPageIdentity(web);
  } catch (const std::exception&) {
    // The certificate may be the error: the page then has its own.
    web.tls_certificate.clear();
    web.tls_key.clear();
    web.plain_http = false;
  }
  config.web = web;
}

void AddVirtualSensorOptions(CLI::App& app, PlumbdOptions& options) {
  app.add_option("--sim-frames", options.sim_frames, "Frames of a simulated sweep, 30 per second")
      ->check(CLI::Range(2, 20000))
      ->group("Virtual sensor");
  app.add_option("--sim-size", options.sim_size, "Size of its images")
      ->check(CLI::IsMember({"640x480", "320x240", "848x480"}))
      ->group("Virtual sensor");
  app.add_option("--sim-seed", options.sim_seed, "Seed of its scenes and noise")
      ->group("Virtual sensor");
  app.add_option("--sim-room", options.sim_room,
                 "Seed of another room and sensor that see the same bodies")
      ->group("Virtual sensor");
  app.add_option("--sim-scenes", options.sim_scenes, "Number of the suite's scenes; 0: all")
      ->check(CLI::Range(0, 1000))
      ->group("Virtual sensor");
  app.add_option("--sim-result-s", options.sim_result_s, "Seconds for which a result is shown")
      ->check(CLI::Range(1, 3600))
      ->group("Virtual sensor");
  app.add_flag("--sim-board", options.sim_board,
               "Start with three scenes of the room calibration board")
      ->group("Virtual sensor");
  app.add_flag("--sim-rest", options.sim_rest,
               "Also render what a sensor at rest sees, for sim mount and sim move")
      ->group("Virtual sensor");
  app.add_flag(
         "--sim-couch", options.sim_couch,
         "The same, and as the couch is brought in steps to where the first body lay, for sim "
         "move 2 and on")
      ->group("Virtual sensor");
  app.add_flag("--sim-unplugged", options.sim_unplugged, "The sensor is not attached at the start")
      ->group("Virtual sensor");
}

}  // namespace

std::optional<fs::path> ConfigFile(const PlumbdOptions& options) {
  std::error_code ignored;
  if (options.config_file) return options.config_file;
  if (options.use_default_config && options.simulated.empty() &&
      fs::exists(kDefaultConfig, ignored))
    return kDefaultConfig;
  return std::nullopt;
}

void AddPlumbdOptions(CLI::App& app, PlumbdOptions& options) {
  app.set_version_flag("--version", fmt::format("plumbd {}", Version()),
                       "Print the version and exit");
  app.add_option("--config", options.config_file,
                 "Configuration, as TOML; default: /etc/plumb/plumb.toml if it exists")
      ->type_name("FILE");
  app.add_flag("--check-config", options.check_config,
               "Check the configuration, report errors, and exit");
  app.add_flag("--show-folders", options.show_folders,
               "Print the state folder and that of received files, also of a configuration that "
               "cannot be used, and exit");
  app.add_flag("--show-stopped", options.show_stopped,
               "Only drive the light, with the pattern for a service that is not running, until "
               "SIGTERM");
  app.add_option("--provision", options.provision,
                 "Apply serial number, name, network, certificate and display of this unit from a "
                 "file, and exit")
      ->type_name("FILE");
  app.add_option("--recover", options.recover,
                 "Confirm lost scans, or restore a backup, as a file says, for a state folder that "
                 "no plumbd works with, and exit")
      ->type_name("FILE");
  app.add_option("--unit", options.unit, "Folder in which --provision stores them")
      ->type_name("DIR")
      ->capture_default_str();
  app.add_option("--simulated", options.simulated,
                 "Use a virtual sensor that plays the scenes of a simulated suite")
      ->check(CLI::IsMember({"demo", "nine", "patient"}))
      ->type_name("demo|nine|patient");
  app.add_option("--state", options.state, "Folder of database, scans and results")
      ->type_name("DIR");
  app.add_option("--listen", options.listen, "Address of the page")->type_name("ADDRESS:PORT");
  app.add_option("--control", options.control, "Control socket")->type_name("SOCK");
  AddVirtualSensorOptions(app, options);
  app.footer(fmt::format("\n{}", kResearchNotice));
}

Settings FirstSettings(const ApplianceConfig& given) {
  Settings first;
  first.auto_stop_s = given.auto_stop_s.value_or(first.auto_stop_s);
  first.scan_limit_s = given.scan_limit_s.value_or(first.scan_limit_s);
  first.keep_recordings = given.keep_recordings.value_or(first.keep_recordings);
  first.code_check_character = given.code_check_character.value_or(first.code_check_character);
  return first;
}

Config ReadConfiguration(const PlumbdOptions& options, const SensorRegistry& registry) {
  Config config;
  if (const std::optional<fs::path> file = ConfigFile(options))
    config = ReadConfig(
        *file, options.simulated.empty() ? ConfigUse::kAppliance : ConfigUse::kSimulatedAppliance);
  if (options.simulated.empty())
    RefuseResearchPresets(config);
  else if (!config.compare.T_iec_reference)
    config.compare.T_iec_reference = SimulatedRoom();
  if (config.region_file) config.compare.region_polygon_m = ReadRegion(*config.region_file);
  CheckPageIdentity(config.web);
  (void)AccessToken(config.peers.secret_file);
  (void)registry.Choose(config.appliance.sensor_driver, !options.simulated.empty());
  if (options.state) {
    config.appliance.state = fs::absolute(*options.state);
    config.update.folder = config.appliance.state / "updates";
  }
  if (options.control) config.appliance.control = fs::absolute(*options.control);
  if (options.listen) {
    if (!ParseListenAddress(*options.listen)) {
      throw InvalidRequest(say::control::ListenOption(*options.listen));
    }
    config.web.listen = *options.listen;
  }
  return config;
}

Configured ReadOrExplain(const PlumbdOptions& options, const SensorRegistry& registry) {
  try {
    return {
        .config = ReadConfiguration(options, registry), .fault = {}, .may_name_backup_key = false};
  } catch (const std::invalid_argument&) {
    throw;  // from the command line
  } catch (const std::exception& error) {
    PlumbdOptions without_file = options;
    without_file.config_file.reset();
    without_file.use_default_config = false;
    const std::optional<fs::path> file = ConfigFile(options);
    Config config = ReadConfiguration(without_file, registry);
    if (file) KeepPanelAndPage(SalvageConfig(*file), options.listen.has_value(), config);
    return {.config = config,
            .fault = say::upkeep::ConfigurationUnusable(MessageOf(error)),
            .may_name_backup_key = file && MayNameBackupKey(*file)};
  }
}

}  // namespace plumb
