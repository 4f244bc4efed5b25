// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/planning/planned_scene.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/cli/watch_recording.hpp"
#include "daemon/evaluation/evaluation.hpp"
#include "daemon/evaluation/live_accuracy.hpp"
#include "daemon/evaluation/report.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "daemon/reports/text_report.hpp"
#include "daemon/result/result_folder.hpp"
#include "drivers/dicom/planning_files.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

struct EvaluateArguments {
  std::filesystem::path suite;
  std::optional<std::filesystem::path> out;
  MethodOptions method;
  bool reuse = false;
  bool results = false;
  bool json = false;
  std::optional<double> part;
};

/// The first frames of a recording.
class FirstFrames : public FrameSource {
 public:
  FirstFrames(std::unique_ptr<FrameSource> whole, double part)
      : whole_(std::move(whole)), info_(whole_->info()) {
    if (!info_.num_frames) return;
    info_.num_frames =
        static_cast<std::int64_t>(std::ceil(part * static_cast<double>(*info_.num_frames)));
  }
  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] std::optional<Frame> Next() override {
    if (info_.num_frames && num_read_ == *info_.num_frames) return std::nullopt;
    ++num_read_;
    return whole_->Next();
  }

 private:
  std::unique_ptr<FrameSource> whole_;
  StreamInfo info_;
  std::int64_t num_read_ = 0;
};

/// @param part  Of the sweep, from its beginning.
Scene Reconstruct(const Suite& suite, const std::string& name, const Config& config, double part,
                  const std::filesystem::path& folder, const CommandContext& context,
                  Progress& progress) {
  const std::filesystem::path structures = suite.recordings.at(name) / "structures.dcm";
  if (std::filesystem::exists(structures)) {
    Scene planned = MakePlannedScene(ReadStructureSet(structures),
                                     ReadTreatmentPlan(suite.recordings.at(name) / "plan.dcm"));
    WriteScene(planned, folder);
    return planned;
  }
  FirstFrames recording(OpenRecording(suite.recordings.at(name), config.markers), part);
  Scene scene = RunScan(recording, {.reconstructor = config.reconstruct}, context.stop,
                        [&](const ScanProgress& scan) { Show(progress, name, scan); });
  WriteScene(scene, folder);
  return scene;
}

// Of a suite's recordings of a sensor at rest.
LiveEvaluation EvaluateLive(const Suite& suite, const EvaluateOptions& evaluate,
                            const Config& config, const std::filesystem::path& out,
                            const CommandContext& context, Progress& progress) {
  LiveEvaluation live;
  std::map<std::string, Scene> scenes;
  const auto scene = [&](const std::string& name) -> const Scene& {
    const std::filesystem::path folder = out / "scenes" / name;  // Made for the pairs already.
    if (!scenes.contains(name))
      scenes[name] = IsSceneFolder(folder) ? ReadScene(folder) : evaluate.get_scene(name);
    return scenes[name];
  };
  const auto evaluate_one = [&](const std::string& name, const std::vector<std::string>& of) {
    LiveTruth truth = ReadLiveTruth(suite.truths.at(of.front()));
    for (std::size_t i = 1; i < of.size(); ++i)
      truth = TruthTogether(truth, ReadLiveTruth(suite.truths.at(of[i])));
    const Scene &reference = scene(truth.reference), &current = scene(truth.scene);
    std::vector<Message> warnings;
    MonitorOptions monitoring = MonitorOptionsOf(evaluate.compare, &reference, current, warnings);
    // The body is moved about its place at the zero: the tolerances are judged since then.
    monitoring.judges_reference = false;
    Recordings recordings;
    for (const std::string& one : of)
      recordings.push_back(OpenRecording(suite.recordings.at(one), config.markers));
    const MonitoringRecord record =
        WatchRecordings(recordings, current, monitoring, name, progress, context);
    EnsureFolder(out / "monitoring");
    WriteMonitoring(record, out / "monitoring" / name);
    live[name] = FiguresOf(record.lines, truth, record.centroid_m, record.reference_centroid_m,
                           ReadSceneTruth(suite.truths.at(truth.reference)).T_world_body,
                           config.compare.limits);
    live[name].cpu_s = record.cpu_s;
  };
  for (const std::string& name : suite.live) evaluate_one(name, {name});
  for (const auto& [name, recordings] : suite.live_together) evaluate_one(name, recordings);
  return live;
}

int Run(const EvaluateArguments& options, const CommandContext& context) {
  MethodOptions method = options.method;
  // A suite with planning CTs brings its room.
  if (const auto room = options.suite / "room.toml";
      !method.config_file && std::filesystem::exists(room))
    method.config_file = room;
  const Config config = method.Read();
  const Suite suite = OpenSuite(options.suite);
  const Preset preset = config.reconstruct.preset;
  const std::filesystem::path out =
      options.out.value_or(options.suite / fmt::format("results-{}", Name(preset)));
  EnsureFolder(out);
  Progress progress(context.language);
  EvaluateOptions evaluate{.compare = config.compare};
  evaluate.compare.preset = preset;
  evaluate.compare.now_s = SteadySeconds;
  const auto get = [&](const std::string& name, const std::filesystem::path& scenes, double part) {
    const std::filesystem::path folder = scenes / name;
    if (options.reuse && IsSceneFolder(folder)) return ReadScene(folder);
    return Reconstruct(suite, name, config, part, folder, context, progress);
  };
  evaluate.get_scene = [&](const std::string& name) { return get(name, out / "scenes", 1.0); };
  if (options.part) {
    evaluate.get_current = [&](const std::string& name) {
      return get(name, out / fmt::format("scenes-part-{:g}", *options.part), *options.part);
    };
  }
  if (options.results) {
    evaluate.store = [&](const std::string& reference, const std::string& current,
                         const Scene& reference_scene, const Comparison& comparison) {
      const HeightMap* heights =
          reference_scene.height_map ? &*reference_scene.height_map : nullptr;
      WriteResult(comparison,
                  DrawResult(comparison, heights,
                             {.tolerance_m = config.compare.limits.shift_tolerance_m,
                              .subtitle = PictureSubtitle(comparison)}),
                  out / "results" / (reference + "_" + current));
    };
  }
  const Evaluation evaluation =
      EvaluateSuite(suite, evaluate, context.stop,
                    [&](const Message& step, double fraction) { progress.Update(step, fraction); });
  const LiveEvaluation live = EvaluateLive(suite, evaluate, config, out, context, progress);
  progress.Clear();
  const std::string json = EvaluationJson(evaluation);
  std::string table = EvaluationTable(evaluation);
  if (!live.empty()) {
    table += "\n" + LiveTable(live);
    WriteFileAtomically(out / "live.json", [&](const std::filesystem::path& file) {
      WriteWholeFile(file, LiveJson(live));
    });
  }
  WriteFileAtomically(out / "evaluation.json",
                      [&](const std::filesystem::path& file) { WriteWholeFile(file, json); });
  WriteFileAtomically(out / "evaluation.txt",
                      [&](const std::filesystem::path& file) { WriteWholeFile(file, table); });
  PrintOut(options.json ? json : table);
  return kDone;
}

}  // namespace

Command AddEvaluate(CLI::App& app) {
  auto options = std::make_shared<EvaluateArguments>();
  app.add_option("suite", options->suite,
                 "Suite folder: recordings/, truth/ and usually suite.json")
      ->required()
      ->type_name("SUITE_DIR");
  app.add_option("--out", options->out,
                 "Folder for scenes and figures; default SUITE_DIR/results-PRESET")
      ->type_name("DIR");
  options->method.AddTo(app);
  options->method.AddSensorTo(app);
  app.add_flag("--reuse", options->reuse,
               "Use the scenes of an earlier run in the folder instead of reconstructing "
               "them again");
  app.add_option("--part", options->part,
                 "Use only this part of each current sweep, from its beginning: the accuracy of "
                 "the numbers that form while one sweeps")
      ->check(CLI::Range(0.05, 1.0))
      ->type_name("FRACTION");
  app.add_flag("--results", options->results, "Write the result folder of every pair too");
  app.add_flag("--json", options->json, "Print the figures as JSON on the standard output");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
