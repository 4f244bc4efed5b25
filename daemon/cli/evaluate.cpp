#include <memory>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/evaluation/evaluation.hpp"
#include "daemon/evaluation/report.hpp"
#include "daemon/files/result_folder.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/files/text_report.hpp"
#include "daemon/pipeline/scan_runner.hpp"
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
};

Scene Reconstruct(const Suite& suite, const std::string& name, const Config& config,
                  const std::filesystem::path& folder, const CommandContext& context,
                  Progress& progress) {
  const std::unique_ptr<FrameSource> recording =
      OpenRecording(suite.recordings.at(name), config.markers);
  Scene scene = RunScan(*recording, {.reconstructor = config.reconstruct}, context.stop,
                        [&](const ScanProgress& scan) { Show(progress, name + ": ", scan); });
  WriteScene(scene, folder);
  return scene;
}

int Run(const EvaluateArguments& options, const CommandContext& context) {
  const Config config = options.method.Read();
  const Suite suite = OpenSuite(options.suite);
  const Preset preset = config.reconstruct.preset;
  const std::filesystem::path out =
      options.out.value_or(options.suite / fmt::format("results-{}", Name(preset)));
  EnsureFolder(out);
  Progress progress;
  EvaluateOptions evaluate{.compare = config.compare};
  evaluate.compare.preset = preset;
  evaluate.compare.now_s = SteadySeconds;
  evaluate.get_scene = [&](const std::string& name) {
    const std::filesystem::path folder = out / "scenes" / name;
    if (options.reuse && IsSceneFolder(folder)) return ReadScene(folder);
    return Reconstruct(suite, name, config, folder, context, progress);
  };
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
  const Evaluation evaluation = EvaluateSuite(
      suite, evaluate, context.stop,
      [&](const std::string& step, double fraction) { progress.Update(step, fraction); });
  progress.Clear();
  const std::string json = EvaluationJson(evaluation), table = EvaluationTable(evaluation);
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
  app.add_flag("--results", options->results, "Write the result folder of every pair too");
  app.add_flag("--json", options->json, "Print the figures as JSON on the standard output");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
