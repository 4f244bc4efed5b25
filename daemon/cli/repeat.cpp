// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <memory>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/comparison/comparison.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "daemon/result/measured_repeats.hpp"
#include "words/cli.hpp"
#include "words/progress.hpp"
#include "words/repeat.hpp"

namespace plumb {
namespace {

struct RepeatArguments {
  std::vector<std::filesystem::path> sweeps;
  MethodOptions method;
  bool json = false;
};

/// "1 (sweep-a)": folders of different sweeps often have the same name.
std::string NameOf(std::size_t index, const std::filesystem::path& path) {
  const std::filesystem::path name = path.has_filename() ? path : path.parent_path();
  return fmt::format("{} ({})", index + 1, name.filename().string());
}

Scene SceneOf(const std::filesystem::path& path, const std::string& name, const Config& config,
              Progress& progress, const CommandContext& context) {
  if (IsSceneFolder(path)) return ReadScene(path);
  const std::unique_ptr<FrameSource> recording = OpenRecording(path, config.markers);
  return RunScan(*recording, {.reconstructor = config.reconstruct}, context.stop,
                 [&](const ScanProgress& scan) { Show(progress, name, scan); });
}

MeasuredRepeats Measure(const RepeatArguments& options, const CommandContext& context) {
  const Config config = options.method.Read();
  Progress progress(context.language);
  std::vector<std::string> names;
  std::vector<Scene> scenes;
  for (const std::filesystem::path& path : options.sweeps) {
    names.push_back(NameOf(scenes.size(), path));
    scenes.push_back(SceneOf(path, names.back(), config, progress, context));
  }
  progress.Update(say::progress::Comparing(), 0.0);
  CompareOptions compare = config.compare;
  compare.stop = context.stop;
  MeasuredRepeats repeats = MeasureRepeats(scenes, names, compare);
  progress.Clear();
  return repeats;
}

std::string Table(const MeasuredRepeats& repeats, const CommandContext& context) {
  constexpr std::size_t kLabel = 14, kColumn = 20;
  std::string text = LeftAligned("", kLabel);
  for (const RepeatedPair& pair : repeats.pairs)
    text +=
        " " + LeftAligned(fmt::format("{} - {}", pair.reference + 1, pair.current + 1), kColumn);
  text += " " + context.Said(say::repeat::Scatter()) + "\n";
  for (std::size_t i = 0; i < kNumberNames.size(); ++i) {
    text += LeftAligned(context.Said(NumberWord(i)), kLabel);
    const auto said = [&](double value) {
      return context.Said(IsShift(i) ? say::repeat::Length(value) : say::repeat::Angle(value));
    };
    for (const RepeatedPair& pair : repeats.pairs) {
      const auto& number = pair.numbers[i];
      const std::string cell =
          !number ? "-"
                  : fmt::format("{} ±{}{}", said(number->value), said(number->u95),
                                std::abs(number->value) <= number->u95 ? "" : " !");
      text += " " + LeftAligned(cell, kColumn);
    }
    const auto& scatter = repeats.judged.scatter[i];
    text += " " + (scatter ? said(*scatter) : std::string("-")) + "\n";
  }
  for (const RepeatedSweep& sweep : repeats.sweeps) {
    if (sweep.chi2_per_term)
      text += context.Said(say::repeat::ChiSquare(sweep.name, *sweep.chi2_per_term)) + "\n";
  }
  text += context.Said(say::repeat::Held(repeats.judged.held, repeats.judged.judged)) + "\n";
  text += context.Said(repeats.judged.is_fit() ? say::repeat::Fit() : say::repeat::NotFit()) + "\n";
  for (const Message& reason : repeats.judged.reasons)
    text += fmt::format("  {}\n", context.Said(reason));
  return text;
}

int Run(const RepeatArguments& options, const CommandContext& context) {
  const MeasuredRepeats repeats = Measure(options, context);
  PrintOut(options.json ? RepeatsJson(repeats).dump(1) + "\n" : Table(repeats, context));
  return repeats.judged.is_fit() ? kDone : kNoAnswer;
}

}  // namespace

Command AddRepeat(CLI::App& app) {
  constexpr int kMostSweeps = 20;
  auto options = std::make_shared<RepeatArguments>();
  app.add_option("sweeps", options->sweeps,
                 "Sweeps of a thing that did not move: recordings, or scenes of them")
      ->required()
      ->expected(2, kMostSweeps)
      ->type_name("RECORDING");
  options->method.AddTo(app);
  options->method.AddSensorTo(app);
  app.add_flag("--json", options->json, "Print the table as JSON on the standard output");
  app.footer("\nExit code 4: sensor or room are not fit; the last lines say why.");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
