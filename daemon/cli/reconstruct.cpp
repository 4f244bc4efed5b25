// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <memory>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "daemon/cli/batch.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/cli/work_digest.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/files/stored_scene.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

struct ReconstructArguments {
  std::filesystem::path recording, list, out;
  ThreadLimit threads;
  MethodOptions method;
  bool realtime = false;
  bool json = false;
};

Message BreathingMessage(const Breathing& breathing) {
  return breathing.amplitude_m > 0.0
             ? say::cli::Breathing(breathing.amplitude_m / kMillimetre,
                                   breathing.sigma_m / kMillimetre, breathing.period_s)
             : say::cli::NoBreathing(breathing.limit_m / kMillimetre);
}

Message HeightMapMessage(const Scene& scene) {
  if (scene.height_map) {
    const GridShape& grid = scene.height_map->grid;
    return say::cli::HeightMap(grid.width, grid.height, grid.step / kMillimetre);
  }
  return scene.frame == SceneFrame::kReferenceMarker ? say::cli::HeightMapNoSurface()
                                                     : say::cli::HeightMapOtherFrame();
}

std::string Summary(const Scene& scene, const std::filesystem::path& out,
                    const CommandContext& context) {
  std::string text = fmt::format("{}\n", out.string());
  const auto line = [&](const Message& label, const std::string& value) {
    text += fmt::format("  {} {}\n", LeftAligned(context.Said(label), 10), value);
  };
  line(say::cli::FramesLabel(), context.Said(say::cli::FramesOf(
                                    scene.frames_tracked, scene.frames_total, scene.frames_dropped,
                                    static_cast<std::int64_t>(scene.keyframes.size()))));
  const auto num_markers = static_cast<std::int64_t>(scene.markers.size());
  line(say::cli::MarkersLabel(), scene.frame == SceneFrame::kReferenceMarker
                                     ? context.Said(say::cli::FrameOfMarker(
                                           num_markers, scene.room_markers.reference.value_or(-1)))
                                     : fmt::to_string(num_markers));
  line(say::cli::HeightMapLabel(), context.Said(HeightMapMessage(scene)));
  if (scene.breathing)
    line(say::cli::BreathingLabel(), context.Said(BreathingMessage(*scene.breathing)));
  line(say::cli::SurfaceLabel(),
       context.Said(say::cli::Surface(static_cast<std::int64_t>(scene.cloud.size()),
                                      static_cast<std::int64_t>(scene.mesh.triangles.size()))));
  if (const auto after = scene.timings_s.find("after_last_frame"); after != scene.timings_s.end())
    line(say::cli::TimeLabel(), context.Said(say::cli::TimeAfter(after->second)));
  for (const Message& warning : scene.warnings) {
    const bool refused = std::ranges::find(scene.refusals, warning) != scene.refusals.end();
    line(refused ? say::cli::RefusedLabel() : say::cli::WarningLabel(), context.Said(warning));
  }
  return text;
}

Scene Reconstructed(const std::filesystem::path& path, const ReconstructArguments& options,
                    const Config& config, const std::filesystem::path& out, const std::string& name,
                    Progress& progress, const CommandContext& context) {
  const std::unique_ptr<FrameSource> recording = OpenRecording(path, config.markers);
  Scene scene =
      RunScan(*recording, {.reconstructor = config.reconstruct, .realtime = options.realtime},
              context.stop, [&](const ScanProgress& scan) { Show(progress, name, scan); });
  progress.Update(say::cli::Writing(), 0.0);
  WriteScene(scene, out);
  progress.Clear();
  return scene;
}

int RunOne(const ReconstructArguments& options, const CommandContext& context) {
  const Config config = options.method.Read();
  {
    const AtomicFolder check(options.out, SceneOutput());
  }  // rejects a bad place before the long work
  Progress progress(context.language);
  const Scene scene =
      Reconstructed(options.recording, options, config, options.out, "", progress, context);
  PrintOut(options.json ? SceneText(options.out) : Summary(scene, options.out, context));
  return kDone;
}

/// A scene that refuses to be compared is an output like any other; its row says so.
BatchAnswer AnswerOf(const std::filesystem::path& output) {
  const StoredScene stored = ReadStoredScene(output);
  const Scene& scene = stored.scene;
  return {
      .verdict = scene.refusals.empty() ? "scene" : "refused",
      .cells = {fmt::to_string(scene.frames_total), fmt::to_string(scene.frames_tracked),
                fmt::to_string(stored.shape.num_keyframes), fmt::to_string(scene.markers.size())}};
}

int RunList(const ReconstructArguments& options, const CommandContext& context) {
  const Config config = options.method.Read();
  constexpr auto kSections = std::to_array<std::string_view>({"markers", "reconstruct"});
  Progress progress(context.language);
  BatchWork work{
      .method = MethodText("reconstruct", config, kSections),
      .inputs = {{"input", "string", "The recording, as the list has it"}},
      .columns = {{"frames_total", "integer", "Frames of the recording"},
                  {"frames_tracked", "integer", "Frames with a pose"},
                  {"keyframes", "integer", "Frames in the joint solution"},
                  {"markers", "integer", "Markers in the scene"}},
      .table = "scenes.csv",
      .is_finished = IsSceneFolder,
      .make =
          [&](const BatchInputs& item, const std::filesystem::path& out, const std::string& name) {
            (void)Reconstructed(item.front(), options, config, out, name, progress, context);
          },
      .read = AnswerOf};
  if (const auto& profile = options.method.profile_file)
    work.method += OptionText("profile", ContentDigest(*profile, context.stop));
  return RunBatch(options.list, options.out, work, context);
}

int Run(const ReconstructArguments& options, const CommandContext& context) {
  if (options.list.empty() == options.recording.empty())
    throw InvalidRequest(say::cli::ListOrPaths());
  return options.threads.Run(
      [&] { return options.list.empty() ? RunOne(options, context) : RunList(options, context); });
}

}  // namespace

Command AddReconstruct(CLI::App& app) {
  auto options = std::make_shared<ReconstructArguments>();
  app.add_option("recording", options->recording,
                 "Recording: a folder in the TUM RGB-D layout, or an .oni file")
      ->type_name("RECORDING");
  CLI::Option* const list =
      app.add_option("--list", options->list,
                     "Reconstruct many recordings: a file with one path a line")
          ->type_name("FILE");
  app.add_option("--out", options->out,
                 "Scene folder to write; with --list the folder of all scenes")
      ->required()
      ->type_name("SCENE");
  options->threads.AddTo(app);
  options->method.AddTo(app);
  options->method.AddSensorTo(app);
  app.add_flag("--realtime", options->realtime,
               "Play the recording at its own pace, dropping frames as a live sensor would")
      ->excludes(list);
  app.add_flag("--json", options->json, "Print scene.json on the standard output")->excludes(list);
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
