// SPDX-License-Identifier: Apache-2.0
#include <time.h>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "algo/comparison/comparison.hpp"
#include "daemon/cli/ask_plumbd.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/cli/watch_recording.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/monitoring_files/monitoring_folder.hpp"
#include "words/cli.hpp"
#include "words/monitoring.hpp"
#include "words/progress.hpp"

namespace plumb {
namespace {

struct MonitorArguments {
  std::vector<std::filesystem::path> recordings;
  std::filesystem::path scene, out;
  std::optional<std::filesystem::path> reference;
  MethodOptions method;
  bool json = false;
};

MonitoringRecord Watch(const MonitorArguments& options, const CommandContext& context) {
  const Config config = options.method.Read();
  Progress progress(context.language);
  progress.Update(say::cli::ReadingScenes(), 0.0);
  const Scene scene = ReadScene(options.scene);
  std::optional<Scene> reference;
  if (options.reference) {
    reference = ReadScene(*options.reference);
    progress.Update(say::progress::Comparing(), 0.0);
  }
  CompareOptions compare = config.compare;
  compare.stop = context.stop;
  std::vector<Message> warnings;
  const MonitorOptions monitoring =
      MonitorOptionsOf(compare, reference ? &*reference : nullptr, scene, warnings);
  Recordings recordings;
  for (const std::filesystem::path& path : options.recordings)
    recordings.push_back(OpenRecording(path, config.markers));
  MonitoringRecord record = WatchRecordings(recordings, scene, monitoring, {}, progress, context);
  record.warnings.insert(record.warnings.begin(), warnings.begin(), warnings.end());
  progress.Clear();
  return record;
}

/// Why it never came to numbers; empty if it did.
Message WhyNot(const MonitoringRecord& record) {
  if (record.began()) return {};
  MonitorState last = MonitorState::kMounting;
  for (const MonitorLine& line : record.judged()) last = std::max(last, line.state);
  return last == MonitorState::kMounting  ? say::monitoring::NeverMounted()
         : last == MonitorState::kZeroing ? say::monitoring::NeverZeroed()
                                          : say::monitoring::NoSurface();
}

std::string Summary(const MonitoringRecord& record, const CommandContext& context) {
  std::string text;
  const auto say = [&](const Message& message) { text += context.Said(message) + "\n"; };
  std::map<LiveAdvice, double> share;
  const std::vector<MonitorLine> lines = record.judged();
  for (const MonitorLine& line : lines)
    share[line.advice] += 100.0 / static_cast<double>(lines.size());
  for (const Message& warning : record.warnings) say(warning);
  if (const Message why = WhyNot(record); !why.empty()) {
    say(why);
    return text;
  }
  say(say::monitoring::Summary(lines.size(), share[LiveAdvice::kIn], share[LiveAdvice::kOut],
                               share[LiveAdvice::kUnknown]));
  const BreathingMode* breathing = record.breathing();
  say(breathing != nullptr
          ? say::monitoring::Breathing(breathing->amplitude_m / kMillimetre, breathing->period_s)
          : say::monitoring::NoBreathing());
  for (const MonitorLine& line : lines) {
    if (line.state != MonitorState::kMovedSensor) continue;
    say(say::monitoring::SensorMoved(line.time_s - record.lines.front().time_s));
    break;
  }
  return text;
}

// `plumb monitor start|stop`: that of a running plumbd.
bool IsForPlumbd(const MonitorArguments& options) {
  const std::string first = options.recordings.front().string();
  return options.recordings.size() == 1 && options.scene.empty() &&
         (first == "start" || first == "stop");
}

int AskForIt(bool starts, const CommandContext& context) {
  constexpr int kTimeout_ms = 10'000;
  const auto answer = AskPlumbd(context.control,
                                {.kind = ControlRequest::Kind::kMonitor,
                                 .is_long = false,
                                 .starts = starts,
                                 .action = {},
                                 .argument = {}},
                                context.stop, kTimeout_ms);
  if (!answer.value("ok", false)) throw DeviceError(WhyRefused(answer));
  return kDone;
}

int Run(const MonitorArguments& options, const CommandContext& context) {
  if (IsForPlumbd(options)) return AskForIt(options.recordings.front() == "start", context);
  { const AtomicFolder check(options.out, MonitoringOutput()); }  // before the work
  const MonitoringRecord record = Watch(options, context);
  WriteMonitoring(record, options.out);
  PrintOut(options.json ? MonitoringJson(record)
                        : Summary(record, context) +
                              context.Said(say::cli::WrittenTo(options.out.string())) + "\n");
  return record.began() ? kDone : kNoAnswer;
}

}  // namespace

MonitoringRecord WatchRecordings(const Recordings& recordings, const Scene& scene,
                                 const MonitorOptions& options, const std::string& name,
                                 Progress& progress, const CommandContext& context) {
  MonitoringRecord record;
  std::vector<StreamInfo> infos;
  double all = 0;
  for (const auto& recording : recordings) {
    infos.push_back(recording->info());
    const std::vector<Message>& warnings = infos.back().warnings;
    record.warnings.insert(record.warnings.end(), warnings.begin(), warnings.end());
    all += static_cast<double>(infos.back().num_frames.value_or(0));
  }
  Monitor monitor(scene, infos, options);
  const Message step = name.empty() ? say::monitoring::Watching()
                                    : say::cli::StepOf(name, say::monitoring::Watching());
  std::vector<std::optional<Frame>> next;
  for (const auto& recording : recordings) next.push_back(recording->Next());
  for (std::size_t frames = 1;; ++frames) {
    std::size_t sensor = 0;
    for (std::size_t i = 1; i < next.size(); ++i) {
      if (next[i] && (!next[sensor] || next[i]->depth_time_s < next[sensor]->depth_time_s))
        sensor = i;
    }
    if (!next[sensor]) break;
    if (context.stop.stop_requested()) throw Interrupted(say::cli::NothingWritten());
    // Of this thread alone: another one decodes the next frames.
    timespec start{}, end{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &start);
    const Frame& frame = *next[sensor];
    const std::optional<MonitorLine> judged = monitor.Add(frame, sensor);
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);
    record.lines.push_back(judged ? *judged : monitor.LineAside(frame, sensor));
    next[sensor] = recordings[sensor]->Next();
    if (judged && judged->state >= MonitorState::kMonitoring)
      record.cpu_s.push_back(static_cast<double>(end.tv_sec - start.tv_sec) +
                             1e-9 * static_cast<double>(end.tv_nsec - start.tv_nsec));
    progress.Update(step, all > 0 ? static_cast<double>(frames) / all : 0.0,
                    say::cli::Frames(frames));
  }
  record.Describe(monitor, options);
  return record;
}

Command AddMonitor(CLI::App& app) {
  auto options = std::make_shared<MonitorArguments>();
  app.add_option("recordings", options->recordings,
                 "Recording of a sensor at rest that sees at least four of the scene's markers; a "
                 "second one is of a second sensor on the same clock. Or start or stop: monitoring "
                 "by a running plumbd, of the body that it scanned last")
      ->required()
      ->expected(1, 2)
      ->type_name("RECORDING");
  app.add_option("--scene", options->scene, "Scene of the body as it lies, just scanned")
      ->type_name("CURRENT_SCENE");
  app.add_option("--reference", options->reference,
                 "Scene of the reference: the advice then judges the motion against it")
      ->type_name("REFERENCE_SCENE");
  app.add_option("--out", options->out, "Folder to write: monitor.csv, monitor.json")
      ->type_name("DIR");
  options->method.AddTo(app);
  app.add_flag("--json", options->json, "Print monitor.json on the standard output");
  app.footer(
      "\nThe recording starts with at least 10 s of a body that lies still. Exit code 4 if "
      "monitoring never began: the files are written and state why.");
  app.callback([options] {
    if (IsForPlumbd(*options)) return;
    if (options->scene.empty()) throw CLI::RequiredError("--scene");
    if (options->out.empty()) throw CLI::RequiredError("--out");
  });
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
