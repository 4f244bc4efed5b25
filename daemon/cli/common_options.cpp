// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/common_options.hpp"

#include <set>
#include <string>

#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "algo/diagnosis/depth_unit.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/files/sensor_profile_file.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "drivers/importers/import.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "words/cli.hpp"
#include "words/output.hpp"

namespace plumb {
namespace {

/// A source whose depth has the unit that the markers show, where nothing states one.
/// @param defaults  Of `open`, which opens the source again from its first frame.
template <typename Source, typename Open>
std::unique_ptr<FrameSource> WithDepthUnit(std::unique_ptr<Source> source,
                                           RecordingDefaults& defaults, const Open& open) {
  if (!source->info().depth_unit_open) return source;
  try {
    defaults.depth_scale = DepthUnitByMarkers(*source);
  } catch (const DataError&) {
    // A damaged image is named where it is read.
  }
  return open();
}

}  // namespace

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
  if (config.markers_scene) {
    Scene taught = ReadStoredScene(*config.markers_scene).scene;
    if (taught.frame != SceneFrame::kReferenceMarker)
      throw DataError(say::cli::MarkersSceneFrame(config.markers_scene->string()));
    config.compare.room_markers = std::move(taught.markers);
  }
  return config;
}

std::unique_ptr<FrameSource> OpenRecording(const std::filesystem::path& path,
                                           const StatedMarkers& markers,
                                           std::optional<double> rate_hz) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    throw DataError(say::cli::NoRecording(path.string()));
  }
  RecordingDefaults defaults;
  defaults.room_markers = markers.Or(defaults.room_markers);
  defaults.rate_hz = rate_hz;
  if (IsImportable(path))
    return WithDepthUnit(OpenImported(path, defaults), defaults,
                         [&] { return OpenImported(path, defaults); });
  if (std::filesystem::is_directory(path, error)) {
    if (!IsTumRecording(path)) RefuseUnreadFormat(path);
    return WithDepthUnit(OpenTumRecording(path, defaults), defaults,
                         [&] { return OpenTumRecording(path, defaults); });
  }
  if (const RecordingKind* kind = BuiltInSensors().KindWithExtension(path.extension().string()))
    return kind->Open(path, defaults);
  // Whatever its name, its contents may be a recording.
  if (const RecordingKind* kind = BuiltInSensors().KindOf(path)) return kind->Open(path, defaults);
  RefuseUnreadFormat(path);
  throw DataError(say::cli::NotARecording(path.string()));
}

void EnsureFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw IoError(say::cli::CannotMakeFolder(folder.string(), error.message()));
}

void Show(Progress& progress, const std::string& name, const ScanProgress& scan) {
  Message detail;
  if (scan.tracking != nullptr)
    detail = scan.frames_dropped > 0
                 ? say::cli::FramesDropped(scan.frames, scan.frames_tracked, scan.frames_dropped)
                 : say::cli::FramesTracked(scan.frames, scan.frames_tracked);
  progress.Update(name.empty() ? scan.step : say::cli::StepOf(name, scan.step), scan.fraction,
                  detail);
}

OutputKind RecordingOutput() {
  return {say::output::Recording(),
          "depth.txt",
          {"rgb", "depth", "rgb.txt", "depth.txt", "camera.yaml", kFewerKeypointsFile}};
}

}  // namespace plumb
