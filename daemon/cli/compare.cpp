// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <vector>

#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "algo/comparison/comparison.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/files/result_folder.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "daemon/result/text_report.hpp"
#include "words/cli.hpp"
#include "words/progress.hpp"

namespace plumb {
namespace {

struct CompareArguments {
  std::filesystem::path reference, current, out;
  std::optional<std::filesystem::path> region;
  std::vector<double> isocentre_m;
  MethodOptions method;
  MethodOptions reference_method;  ///< Only its --config: the room of the reference.
  bool paper_colors = false;
  bool json = false;
};

CompareOptions MethodOf(const CompareArguments& options) {
  CompareOptions compare = options.method.Read().compare;
  if (options.region) compare.region_polygon_m = ReadRegion(*options.region);
  if (!options.isocentre_m.empty())
    compare.isocentre_m = Eigen::Vector3d(options.isocentre_m.data());
  if (options.reference_method.config_file) {
    CompareOptions room = options.reference_method.Read().compare;
    compare.reference_room = {.T_iec_reference = room.T_iec_reference,
                              .u95_m = room.iec_u95_m,
                              .u95_rad = room.iec_u95_rad,
                              .markers = std::move(room.room_markers)};
  }
  compare.now_s = SteadySeconds;
  return compare;
}

int Run(const CompareArguments& options, const CommandContext& context) {
  const CompareOptions method = MethodOf(options);
  { const AtomicFolder check(options.out, ResultOutput()); }  // rejects a bad place before the work
  Progress progress(context.language);
  const auto stop_if_asked = [&] {
    if (context.stop.stop_requested()) throw Interrupted(say::cli::NothingWritten());
  };
  progress.Update(say::cli::ReadingScenes(), 0.1);
  const Scene reference = ReadScene(options.reference);
  stop_if_asked();
  const Scene current = ReadScene(options.current);
  stop_if_asked();
  progress.Update(say::progress::Comparing(), 0.3);
  Comparison comparison = Compare(reference, current, method);
  stop_if_asked();
  progress.Update(say::cli::Drawing(), 0.8);
  const double start_s = SteadySeconds();
  const ResultPictures pictures =
      DrawResult(comparison, reference.height_map ? &*reference.height_map : nullptr,
                 {.tolerance_m = method.limits.shift_tolerance_m,
                  .paper_colors = options.paper_colors,
                  .subtitle = PictureSubtitle(comparison)});
  comparison.timings_s["pictures"] = SteadySeconds() - start_s;
  stop_if_asked();
  progress.Update(say::cli::Writing(), 0.9);
  WriteResult(comparison, pictures, options.out);
  progress.Clear();
  const StoredResult result = Stored(comparison);
  PrintOut(options.json ? ResultText(result)
                        : ComparisonText(result, context.language) + "\n" +
                              context.Said(say::cli::WrittenTo(options.out.string())) + "\n");
  return comparison.verdict == Verdict::kNoAnswer ? kNoAnswer : kDone;
}

}  // namespace

Command AddCompare(CLI::App& app) {
  auto options = std::make_shared<CompareArguments>();
  app.add_option("reference", options->reference, "Scene folder of the reference")
      ->required()
      ->type_name("REFERENCE_SCENE");
  app.add_option("current", options->current, "Scene folder of the current scan")
      ->required()
      ->type_name("CURRENT_SCENE");
  app.add_option("--out", options->out, "Result folder to write")->required()->type_name("RESULT");
  options->method.AddTo(app);
  app.add_option("--reference-config", options->reference_method.config_file,
                 "The room of the reference, where that is another one: its [iec] as TOML")
      ->type_name("FILE");
  app.add_option("--region", options->region,
                 "Region of interest, a JSON polygon in the reference marker's frame; default: the "
                 "segmented body")
      ->type_name("FILE");
  app.add_option(
         "--isocentre", options->isocentre_m,
         "Isocentre in the reference marker's frame, metres; default: the region's centroid")
      ->expected(3)
      ->type_name("X Y Z");
  app.add_flag("--paper-colours", options->paper_colors,
               "Draw the error map on the paper's scale: |e|, blue at 0 to red at 10 cm");
  app.add_flag("--json", options->json, "Print result.json on the standard output");
  app.footer("\nExit code 4 with the verdict no_answer: the result is written and states why.");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
