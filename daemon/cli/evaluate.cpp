// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/planning/ct_skin.hpp"
#include "daemon/cli/batch.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/cli/shared_outputs.hpp"
#include "daemon/cli/watch_recording.hpp"
#include "daemon/cli/work_digest.hpp"
#include "daemon/evaluation/evaluation.hpp"
#include "daemon/evaluation/live_accuracy.hpp"
#include "daemon/evaluation/live_endless.hpp"
#include "daemon/evaluation/report.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "daemon/planning/planning_import.hpp"
#include "daemon/reports/text_report.hpp"
#include "daemon/result/result_folder.hpp"
#include "drivers/files/file_io.hpp"
#include "words/cli.hpp"
#include "words/output.hpp"

namespace plumb {
namespace {

struct EvaluateArguments {
  std::filesystem::path suite, list;
  std::optional<std::filesystem::path> out;
  MethodOptions method;
  ThreadLimit threads;
  bool reuse = false;
  bool results = false;
  bool json = false;
  std::optional<double> part;
  std::string endless;  ///< A simulated::EndlessKind; empty: suites.
  EndlessOptions hours;
  std::string endless_size = "320x240", endless_sensor = "structured_light";
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
  const std::filesystem::path planning = suite.recordings.at(name), plan = planning / "plan.dcm";
  if (std::filesystem::exists(plan)) {
    const std::filesystem::path images = planning / "images";
    const Scene planned =
        std::filesystem::exists(images)
            ? ReadPlanningWithImages({.structures = {}, .plan = plan},
                                     ImagesIn({images}, kSkinThreshold_hu, context.stop), {})
                  .scene
            : ReadPlanning({.structures = planning / "structures.dcm", .plan = plan}, {}).scene;
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
    live[name] = FiguresOf(record.judged(), truth, record.centroid_m, record.reference_centroid_m,
                           ReadSceneTruth(suite.truths.at(truth.reference)).T_world_body,
                           config.compare.limits);
    live[name].cpu_s = record.cpu_s;
  };
  for (const std::string& name : suite.live) evaluate_one(name, {name});
  for (const auto& [name, recordings] : suite.live_together) evaluate_one(name, recordings);
  return live;
}

/// A suite with planning CTs brings its room.
Config ConfigFor(const EvaluateArguments& options, const std::filesystem::path& suite) {
  MethodOptions method = options.method;
  if (const auto room = suite / "room.toml"; !method.config_file && std::filesystem::exists(room))
    method.config_file = room;
  return method.Read();
}

/// Makes or finds the scene of a part of a sweep.
using SceneMaker = std::function<Scene(const std::string& name, double part)>;

struct Figures {
  std::string json, table;
};

/// Writes the figures of one suite into a folder.
/// @param item  Of a list, for its progress.
Figures EvaluateInto(const std::filesystem::path& out, const Suite& suite, const Config& config,
                     const SceneMaker& get, const EvaluateArguments& options,
                     const std::string& item, Progress& progress, const CommandContext& context) {
  EvaluateOptions evaluate{.compare = config.compare};
  evaluate.compare.preset = config.reconstruct.preset;
  evaluate.compare.now_s = SteadySeconds;
  evaluate.get_scene = [&](const std::string& name) { return get(name, 1.0); };
  if (options.part)
    evaluate.get_current = [&](const std::string& name) { return get(name, *options.part); };
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
      EvaluateSuite(suite, evaluate, context.stop, [&](const Message& step, double fraction) {
        progress.Update(item.empty() ? step : say::cli::StepOf(item, step), fraction);
      });
  const LiveEvaluation live = EvaluateLive(suite, evaluate, config, out, context, progress);
  progress.Clear();
  Figures figures{.json = EvaluationJson(evaluation), .table = EvaluationTable(evaluation)};
  if (!live.empty()) figures.table += "\n" + LiveTable(live);
  const auto write = [&](const char* name, const std::string& text) {
    WriteFileAtomically(out / name,
                        [&](const std::filesystem::path& file) { WriteWholeFile(file, text); });
  };
  if (!live.empty()) write("live.json", LiveJson(live));
  write("evaluation.txt", figures.table);
  write("evaluation.json", figures.json);
  return figures;
}

int RunOne(const EvaluateArguments& options, const CommandContext& context) {
  const Config config = ConfigFor(options, options.suite);
  const Suite suite = OpenSuite(options.suite);
  const std::filesystem::path out = options.out.value_or(
      options.suite / fmt::format("results-{}", Name(config.reconstruct.preset)));
  EnsureFolder(out);
  Progress progress(context.language);
  const auto get = [&](const std::string& name, double part) {
    const std::filesystem::path folder =
        out / (part < 1.0 ? fmt::format("scenes-part-{:g}", part) : std::string("scenes")) / name;
    if (options.reuse && IsSceneFolder(folder)) return ReadScene(folder);
    return Reconstruct(suite, name, config, part, folder, context, progress);
  };
  const Figures figures = EvaluateInto(out, suite, config, get, options, "", progress, context);
  PrintOut(options.json ? figures.json : figures.table);
  return kDone;
}

OutputKind EvaluationOutput() {
  return {say::output::Evaluation(),
          "evaluation.json",
          {"evaluation.json", "evaluation.txt", "live.json", "monitoring"}};
}

/// What decides about the scenes of a suite, as for `plumb reconstruct --list`, so that its scenes
/// are used.
std::string MethodOfScenes(const EvaluateArguments& options, const Config& config, double part,
                           const CommandContext& context) {
  constexpr auto kSections = std::to_array<std::string_view>({"markers", "reconstruct"});
  std::string text = MethodText("reconstruct", config, kSections);
  if (const auto& profile = options.method.profile_file)
    text += OptionText("profile", ContentDigest(*profile, context.stop));
  if (part < 1.0) text += OptionText("part", fmt::to_string(part));
  return text;
}

/// Everything that decides about the figures of a suite: its description, recordings and truths.
/// What else lies in its folder, such as results of an earlier evaluation, does not.
std::string NameOfEvaluation(const std::filesystem::path& folder, const EvaluateArguments& options,
                             const CommandContext& context) {
  constexpr auto kSections =
      std::to_array<std::string_view>({"markers", "reconstruct", "compare", "iec"});
  const Config config = ConfigFor(options, folder);
  const Suite suite = OpenSuite(folder);
  std::string text = MethodText("evaluate", config, kSections) +
                     MethodOfScenes(options, config, options.part.value_or(1.0), context);
  const auto add = [&](const std::filesystem::path& path) {
    text += OptionText("content", ContentDigest(path, context.stop));
  };
  for (const auto& file : {config.region_file, config.markers_scene})
    text += OptionText("file", file ? ContentDigest(*file, context.stop) : "");
  if (const auto file = folder / "suite.json"; std::filesystem::exists(file)) add(file);
  for (const auto* paths : {&suite.recordings, &suite.truths}) {
    for (const auto& [name, path] : *paths) {
      text += OptionText("scene", name);
      add(path);
    }
  }
  return WorkName(text, {}, context.stop);
}

/// Finds a scene in the folder that all suites of a list share, or makes it. It is always read, so
/// that a run that was killed gives the same bits as one that was not.
Scene SharedScene(const std::filesystem::path& scenes, const Suite& suite, const std::string& name,
                  const Config& config, double part, const EvaluateArguments& options,
                  Progress& progress, const CommandContext& context) {
  const std::filesystem::path recording = suite.recordings.at(name);
  const std::filesystem::path folder =
      scenes /
      WorkName(MethodOfScenes(options, config, part, context), {&recording, 1}, context.stop);
  while (!IsSceneFolder(folder)) {
    const OutputLock lock(scenes, folder.filename().string());
    if (lock.IsHeld() && !IsSceneFolder(folder))
      (void)Reconstruct(suite, name, config, part, folder, context, progress);
    else if (!lock.IsHeld())
      WaitForOthers(context.stop);
  }
  return ReadScene(folder);
}

BatchAnswer AnswerOfEvaluation(const std::filesystem::path& output) {
  constexpr std::size_t kMostBytes = std::size_t{64} << 20;
  const std::filesystem::path file = output / "evaluation.json";
  try {
    const auto json = ParseBoundedJson(ReadTextFile(file, kMostBytes));
    const auto& total = json.at("total");
    const auto& intervals = total.at("intervals_95").at("all");
    TableRow cells = {json.at("suite").get<std::string>()};
    for (const char* key : {"pairs", "no_answer", "without_motion"})
      cells.push_back(fmt::to_string(total.at(key).get<std::size_t>()));
    for (const char* kind : {"translation_mm", "rotation_deg"}) {
      const auto& summary = total.at(kind);
      const bool is_known = summary.at("count").get<std::size_t>() > 0;
      for (const char* key : {"median", "p95", "max"})
        cells.push_back(is_known ? fmt::to_string(summary.at(key).get<double>()) : std::string());
    }
    for (const char* key : {"count", "inside"})
      cells.push_back(fmt::to_string(intervals.at(key).get<std::size_t>()));
    cells.push_back(
        fmt::to_string(total.at("verdicts").at("false_in_tolerance").get<std::size_t>()));
    return {.verdict = "evaluated", .cells = std::move(cells)};
  } catch (const nlohmann::json::exception&) {
    throw DataError(say::cli::EvaluationDamaged(file.string()));
  }
}

std::vector<TableColumn> FigureColumns() {
  std::vector<TableColumn> columns = {
      {"suite", "string", "Name of the suite"},
      {"pairs", "integer", "Pairs that were compared"},
      {"no_answer", "integer", "Pairs without an answer"},
      {"without_motion", "integer", "Pairs for which no motion was computed"}};
  for (const char* kind : {"translation_mm", "rotation_deg"}) {
    for (const char* key : {"median", "p95", "max"})
      columns.push_back({fmt::format("{}_{}", key, kind), "double",
                         "Error of the body's motion; empty: no motion was computed"});
  }
  columns.push_back({"intervals", "integer", "Numbers with an interval of 95 %"});
  columns.push_back({"intervals_that_hold", "integer", "Of these, with the truth inside"});
  columns.push_back({"false_in_tolerance", "integer", "Out of tolerance, but called in"});
  return columns;
}

int RunList(const EvaluateArguments& options, const CommandContext& context) {
  const std::filesystem::path out = *options.out, scenes = out / "scenes";
  EnsureFolder(scenes);
  RemoveUnfinished(scenes);
  Progress progress(context.language);
  const auto make = [&](const BatchInputs& item, const std::filesystem::path& output,
                        const std::string& name) {
    const Config config = ConfigFor(options, item.front());
    const Suite suite = OpenSuite(item.front());
    AtomicFolder folder(output, EvaluationOutput());
    const auto get = [&](const std::string& scene, double part) {
      return SharedScene(scenes, suite, scene, config, part, options, progress, context);
    };
    (void)EvaluateInto(folder.path(), suite, config, get, options, name, progress, context);
    folder.Commit();
  };
  const BatchWork work{
      .method = {},  // In the name.
      .inputs = {{"input", "string", "The suite, as the list has it"}},
      .columns = FigureColumns(),
      .table = "evaluations.csv",
      .name =
          [&](const BatchInputs& item) { return NameOfEvaluation(item.front(), options, context); },
      .is_finished =
          [](const std::filesystem::path& output) {
            return std::filesystem::exists(output / "evaluation.json");
          },
      .make = make,
      .read = AnswerOfEvaluation};
  return RunBatch(options.list, out, work, context);
}

int RunHours(const EvaluateArguments& options, const CommandContext& context) {
  if (!options.out) throw InvalidRequest(say::cli::ListOrPaths());
  EndlessOptions hours = options.hours;
  hours.kind = Named<simulated::EndlessKind>(options.endless).value();
  hours.simulate.sensor = Named<DepthSensor>(options.endless_sensor).value();
  if (options.endless_size == "320x240") hours.simulate.width = 320, hours.simulate.height = 240;
  hours.limits = options.method.Read().compare.limits;
  hours.out = *options.out;
  EnsureFolder(hours.out);
  Progress progress(context.language);
  const std::string table = RunEndless(hours, context.stop, [&](int part, double fraction) {
    progress.Update(say::cli::StepOf(std::to_string(part), say::cli::Simulating()), fraction);
  });
  progress.Clear();
  PrintOut(table);
  return kDone;
}

int Run(const EvaluateArguments& options, const CommandContext& context) {
  if (!options.endless.empty())
    return options.threads.Run([&] { return RunHours(options, context); });
  if (options.list.empty() == options.suite.empty() || (options.suite.empty() && !options.out))
    throw InvalidRequest(say::cli::ListOrPaths());
  return options.threads.Run(
      [&] { return options.list.empty() ? RunOne(options, context) : RunList(options, context); });
}

template <typename Enum>
CLI::IsMember NamesOf() {
  return CLI::IsMember(std::vector<std::string>(kNamesOf<Enum>.begin(), kNamesOf<Enum>.end()));
}

/// What concerns monitoring for hours.
void AddHoursOptions(CLI::App& app, const std::shared_ptr<EvaluateArguments>& options,
                     CLI::Option* list) {
  EndlessOptions& hours = options->hours;
  CLI::Option* const endless =
      app.add_option(
             "--live-endless", options->endless,
             "No suite: monitor simulated units for hours, rendered and judged on the fly, "
             "in parts that are kept in --out; a run that was ended goes on. moves: the body "
             "leaves its place and comes back; still: it breathes; drift: the sensor warms up")
          ->check(NamesOf<simulated::EndlessKind>())
          ->excludes(list)
          ->type_name("moves|still|drift");
  const auto add = [&](CLI::Option* option) { option->needs(endless)->capture_default_str(); };
  add(app.add_option("--parts", hours.parts, "Parts, each with a unit of its own")
          ->check(CLI::Range(1, 10000))
          ->type_name("N"));
  add(app.add_option("--part-seconds", hours.part_s, "Simulated length of a part")
          ->check(CLI::Range(20.0, 36000.0))
          ->type_name("S"));
  add(app.add_option("--rate", hours.rate_hz, "Frames per second")
          ->check(CLI::Range(1.0, 30.0))
          ->type_name("HZ"));
  add(app.add_option("--seed", hours.simulate.seed, "Seed and unit of the first part")
          ->type_name("N"));
  add(app.add_option("--frames", hours.simulate.frames, "Frames of each sweep")
          ->check(CLI::Range(20, 1000))
          ->type_name("N"));
  add(app.add_option("--size", options->endless_size, "Size of the images")
          ->check(CLI::IsMember({"640x480", "320x240"}))
          ->type_name("640x480|320x240"));
  add(app.add_option("--sensor", options->endless_sensor, "Class of the depth camera")
          ->check(NamesOf<DepthSensor>())
          ->type_name("structured_light|active_stereo|time_of_flight|lidar"));
}

}  // namespace

Command AddEvaluate(CLI::App& app) {
  auto options = std::make_shared<EvaluateArguments>();
  app.add_option("suite", options->suite,
                 "Suite folder: recordings/, truth/ and usually suite.json")
      ->type_name("SUITE_DIR");
  CLI::Option* const list =
      app.add_option("--list", options->list,
                     "Evaluate many suites: a file with one folder a line; needs --out")
          ->type_name("FILE");
  app.add_option("--out", options->out,
                 "Folder for scenes and figures; default SUITE_DIR/results-PRESET")
      ->type_name("DIR");
  options->threads.AddTo(app);
  options->method.AddTo(app);
  options->method.AddSensorTo(app);
  app.add_flag("--reuse", options->reuse,
               "Use the scenes of an earlier run in the folder instead of reconstructing "
               "them again")
      ->excludes(list);
  app.add_option("--part", options->part,
                 "Use only this part of each current sweep, from its beginning: the accuracy of "
                 "the numbers that form while one sweeps")
      ->check(CLI::Range(0.05, 1.0))
      ->type_name("FRACTION");
  app.add_flag("--results", options->results, "Write the result folder of every pair too")
      ->excludes(list);
  app.add_flag("--json", options->json, "Print the figures as JSON on the standard output")
      ->excludes(list);
  AddHoursOptions(app, options, list);
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
