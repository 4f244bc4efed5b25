#include <memory>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/files/result_folder.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/files/scene_json.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/replay/tum_index.hpp"
#include "drivers/replay/tum_recording.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::size_t kMaxJsonBytes = std::size_t{64} << 20;

struct InfoArguments {
  fs::path path;
  bool json = false;
};

/// Stamps of the depth images in seconds, without decoding any image.
std::vector<double> DepthStamps(const fs::path& recording) {
  if (const RecordingKind* kind = BuiltInSensors().KindOf(recording))
    return kind->DepthStamps(recording);
  std::vector<double> stamps_s;
  const fs::path index = recording / "depth.txt";
  for (const IndexEntry& entry : ParseIndex(ReadTextFile(index, kMaxJsonBytes), index.string()))
    stamps_s.push_back(entry.time_s);
  return stamps_s;
}

bool IsRecording(const fs::path& path) {
  return BuiltInSensors().KindOf(path) != nullptr || IsTumRecording(path);
}

ordered_json RecordingFacts(const fs::path& path) {
  const std::unique_ptr<FrameSource> recording = OpenRecording(path, {});
  const StreamInfo& info = recording->info();
  const std::vector<double> depth_s = DepthStamps(path);
  const double duration_s = depth_s.size() > 1 ? depth_s.back() - depth_s.front() : 0.0;
  const Intrinsics& camera = info.intrinsics;
  ordered_json facts = {
      {"kind", "recording"},
      {"frames", info.num_frames.value_or(0)},
      {"duration_s", duration_s},
      {"rate_hz", duration_s > 0 ? static_cast<double>(depth_s.size() - 1) / duration_s : 0.0},
      {"image_width", camera.width},
      {"image_height", camera.height},
      {"focal_px", {camera.fx, camera.fy}},
      {"centre_px", {camera.cx, camera.cy}},
      {"distortion", camera.distortion},
      {"calibration", info.intrinsics_assumed  ? "assumed"
                      : fs::is_directory(path) ? "from camera.yaml"
                                               : "from the file beside it"},
      {"depth_noise",
       {{"constant_m", info.depth_noise.constant_m},
        {"linear_m_per_m", info.depth_noise.linear_m_per_m},
        {"quadratic_m_per_m2", info.depth_noise.quadratic_m_per_m2},
        {"origin_m", info.depth_noise.origin_m},
        {"grazing_m", info.depth_noise.grazing_m}}},
      {"marker_dictionary", info.marker_dictionary},
      {"marker_length_m", info.marker_length_m},
      {"reference_marker", nullptr},
      {"warnings", info.warnings}};
  if (info.reference_marker) facts["reference_marker"] = *info.reference_marker;
  return facts;
}

/// One line per fact; nested values as short JSON.
std::string Lines(const ordered_json& facts) {
  std::string text;
  for (const auto& [key, value] : facts.items()) {
    if (value.is_object()) {
      text += fmt::format("{}\n", key);
      for (const auto& [inner, v] : value.items())
        text +=
            fmt::format("  {:<32} {}\n", inner, v.is_string() ? v.get<std::string>() : v.dump());
    } else if (value.is_array() && !value.empty() && value.front().is_string()) {
      text += fmt::format("{}\n", key);
      for (const auto& v : value) text += fmt::format("  {}\n", v.get<std::string>());
    } else {
      text += fmt::format("{:<34} {}\n", key,
                          value.is_string() ? value.get<std::string>() : value.dump());
    }
  }
  return text;
}

int Run(const InfoArguments& options) {
  ordered_json facts;
  if (IsSceneFolder(options.path)) {
    facts = {{"kind", "scene"}};
    facts.update(ordered_json::parse(
        SceneJson(ReadScene(options.path, {.cloud = false, .height_map = false, .mesh = false}))));
  } else if (IsResultFolder(options.path)) {
    facts = {{"kind", "result"}};
    facts.update(ordered_json::parse(ReadResultJson(options.path)));
  } else if (IsRecording(options.path)) {
    facts = RecordingFacts(options.path);
  } else {
    throw DataError(
        fmt::format("'{}' is neither a recording (rgb.txt, depth.txt, or an .oni file) nor a scene "
                    "(scene.json) nor a result (result.json){}",
                    options.path.string(), fs::exists(options.path) ? "" : "; it does not exist"));
  }
  PrintOut(options.json ? facts.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n"
                        : Lines(facts));
  return kDone;
}

}  // namespace

Command AddInfo(CLI::App& app) {
  auto options = std::make_shared<InfoArguments>();
  app.add_option("path", options->path,
                 "A recording (folder or .oni file), or the folder of a scene or a result")
      ->required()
      ->type_name("RECORDING|SCENE|RESULT");
  app.add_flag("--json", options->json, "Print JSON on the standard output");
  return [options](const CommandContext&) { return Run(*options); };
}

}  // namespace plumb
