#include "daemon/cli/common_options.hpp"

#include <set>
#include <string>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/files/sensor_profile_file.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/replay/tum_recording.hpp"

namespace plumb {

void MethodOptions::AddTo(CLI::App& app) {
  app.add_option("--preset", preset,
                 "best: the most accurate method (default); paper: the method as published")
      ->check(
          CLI::IsMember(std::set<std::string>(kNamesOf<Preset>.begin(), kNamesOf<Preset>.end())))
      ->type_name("best|paper");
  app.add_option("--config", config_file, "Options of the method, as TOML")->type_name("FILE");
}

void MethodOptions::AddSensorTo(CLI::App& app) {
  app.add_option("--sensor-profile", profile_file,
                 "Profile of this sensor unit, from plumb calibrate")
      ->type_name("PROFILE");
}

Config MethodOptions::Read() const {
  Config config = config_file ? ReadConfig(*config_file) : Config{};
  if (preset) config.reconstruct.preset = config.compare.preset = Named<Preset>(*preset).value();
  if (profile_file) config.reconstruct.profile = ReadSensorProfile(*profile_file);
  if (config.region_file) config.compare.region_polygon_m = ReadRegion(*config.region_file);
  return config;
}

std::unique_ptr<FrameSource> OpenRecording(const std::filesystem::path& path,
                                           const MarkerConfig& markers) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    throw DataError(
        fmt::format("no recording at '{}': expected a folder in the TUM RGB-D layout (rgb.txt, "
                    "depth.txt) or an .oni file, found nothing",
                    path.string()));
  }
  RecordingDefaults defaults;
  if (markers.dictionary) defaults.marker_dictionary = *markers.dictionary;
  if (markers.length_m) defaults.marker_length_m = *markers.length_m;
  defaults.reference_marker = markers.reference;
  if (std::filesystem::is_directory(path, error)) return OpenTumRecording(path, defaults);
  if (const RecordingKind* kind = BuiltInSensors().KindWithExtension(path.extension().string()))
    return kind->Open(path, defaults);
  // Whatever its name, its contents may be a recording.
  if (const RecordingKind* kind = BuiltInSensors().KindOf(path)) return kind->Open(path, defaults);
  throw DataError(fmt::format(
      "'{}' is neither a folder nor a file of a kind that this build reads; expected a "
      "folder in the TUM RGB-D layout (rgb.txt, depth.txt), or an .oni file where Plumb "
      "was built with OpenNI2",
      path.string()));
}

void EnsureFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    throw IoError(fmt::format("cannot make the folder '{}': {}", folder.string(), error.message()));
}

void Show(Progress& progress, const std::string& prefix, const ScanProgress& scan) {
  std::string detail;
  if (scan.tracking != nullptr) {
    detail = fmt::format("frame {}, {} tracked", scan.frames, scan.frames_tracked);
    if (scan.frames_dropped > 0) detail += fmt::format(", {} dropped", scan.frames_dropped);
  }
  progress.Update(prefix + std::string(scan.step), scan.fraction, detail);
}

}  // namespace plumb
