// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <memory>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "algo/comparison/comparison.hpp"
#include "daemon/cli/batch.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/cli/work_digest.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "daemon/reports/text_report.hpp"
#include "daemon/result/result_folder.hpp"
#include "daemon/result/shown_rows.hpp"
#include "words/cli.hpp"
#include "words/progress.hpp"

namespace plumb {
namespace {

struct CompareArguments {
  std::filesystem::path reference, current, list, out;
  ThreadLimit threads;
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

StoredResult Compared(const BatchInputs& scenes, const CompareOptions& method,
                      const CompareArguments& options, const std::filesystem::path& out,
                      const std::string& name, Progress& progress, const CommandContext& context) {
  const auto enter = [&](const Message& step, double fraction) {
    if (context.stop.stop_requested()) throw Interrupted(say::cli::NothingWritten());
    progress.Update(name.empty() ? step : say::cli::StepOf(name, step), fraction);
  };
  enter(say::cli::ReadingScenes(), 0.1);
  const Scene reference = ReadScene(scenes.at(0));
  enter(say::cli::ReadingScenes(), 0.2);
  const Scene current = ReadScene(scenes.at(1));
  enter(say::progress::Comparing(), 0.3);
  Comparison comparison = Compare(reference, current, method);
  enter(say::cli::Drawing(), 0.8);
  const double start_s = SteadySeconds();
  const ResultPictures pictures =
      DrawResult(comparison, reference.height_map ? &*reference.height_map : nullptr,
                 {.tolerance_m = method.limits.shift_tolerance_m,
                  .paper_colors = options.paper_colors,
                  .subtitle = PictureSubtitle(comparison)});
  comparison.timings_s["pictures"] = SteadySeconds() - start_s;
  enter(say::cli::Writing(), 0.9);
  WriteResult(comparison, pictures, out);
  progress.Clear();
  return Stored(comparison);
}

int RunOne(const CompareArguments& options, const CommandContext& context) {
  const CompareOptions method = MethodOf(options);
  { const AtomicFolder check(options.out, ResultOutput()); }  // rejects a bad place before the work
  Progress progress(context.language);
  const StoredResult result = Compared({options.reference, options.current}, method, options,
                                       options.out, "", progress, context);
  PrintOut(options.json ? ResultText(result)
                        : ComparisonText(result, context.language) + "\n" +
                              context.Said(say::cli::WrittenTo(options.out.string())) + "\n");
  return result.verdict == Verdict::kNoAnswer ? kNoAnswer : kDone;
}

/// Numbers that must not be acted on are not in the table, as they are in no other one.
BatchAnswer ComparisonAnswer(const std::filesystem::path& output) {
  const StoredResult result = ReadResult(output);
  std::vector<ShownRow> rows(kNumberNames.size());
  if (const std::vector<ShownRow> shown = ShownRowsOf(result); !shown.empty()) rows = shown;
  TableRow cells;
  for (const auto number : {&ShownRow::value, &ShownRow::u95})
    for (const ShownRow& row : rows)
      cells.push_back(row.*number ? fmt::to_string(*(row.*number)) : std::string());
  return {.exit_code = result.verdict == Verdict::kNoAnswer ? kNoAnswer : kDone,
          .verdict = std::string(Name(result.verdict)),
          .cells = std::move(cells)};
}

std::vector<TableColumn> NumberColumns() {
  std::vector<TableColumn> columns;
  for (const char* prefix : {"", "u95_"}) {
    for (std::size_t i = 0; i < std::size(kNumberNames); ++i) {
      columns.push_back({fmt::format("{}{}_{}", prefix, kNumberNames[i], UnitOf(i)), "double",
                         *prefix == 0 ? "What restores the position; empty: not known or no answer"
                                      : "Half-width of the interval of 95 %"});
    }
  }
  return columns;
}

/// Everything but the scenes that decides about a result.
std::string MethodOfAll(const CompareArguments& options, const CommandContext& context) {
  constexpr auto kSections = std::to_array<std::string_view>({"markers", "compare", "iec"});
  const Config config = options.method.Read();
  std::string text = MethodText("compare", config, kSections);
  const auto add_file = [&](const char* option, const std::optional<std::filesystem::path>& file) {
    if (file) text += OptionText(option, ContentDigest(*file, context.stop));
  };
  add_file("region_file", config.region_file);
  add_file("markers_scene", config.markers_scene);
  add_file("region", options.region);
  if (options.reference_method.config_file) {
    const Config room = options.reference_method.Read();
    text += MethodText("reference", room, kSections);
    add_file("markers_scene", room.markers_scene);
  }
  for (const double metres : options.isocentre_m) text += OptionText("m", fmt::to_string(metres));
  return text + OptionText("paper_colours", options.paper_colors ? "1" : "0");
}

int RunList(const CompareArguments& options, const CommandContext& context) {
  const CompareOptions method = MethodOf(options);
  Progress progress(context.language);
  const BatchWork work{
      .method = MethodOfAll(options, context),
      .inputs = {{"reference", "string", "Scene of the reference, as the list has it"},
                 {"current", "string", "Scene of the current scan, as the list has it"}},
      .columns = NumberColumns(),
      .table = "results.csv",
      .is_finished = IsResultFolder,
      .make =
          [&](const BatchInputs& item, const std::filesystem::path& out, const std::string& name) {
            (void)Compared(item, method, options, out, name, progress, context);
          },
      .read = ComparisonAnswer};
  return RunBatch(options.list, options.out, work, context);
}

int Run(const CompareArguments& options, const CommandContext& context) {
  const bool has_paths = !options.reference.empty() && !options.current.empty();
  if (has_paths == !options.list.empty() || has_paths != !options.reference.empty())
    throw InvalidRequest(say::cli::ListOrPaths());
  return options.threads.Run(
      [&] { return has_paths ? RunOne(options, context) : RunList(options, context); });
}

}  // namespace

Command AddCompare(CLI::App& app) {
  auto options = std::make_shared<CompareArguments>();
  app.add_option("reference", options->reference, "Scene folder of the reference")
      ->type_name("REFERENCE_SCENE");
  app.add_option("current", options->current, "Scene folder of the current scan")
      ->type_name("CURRENT_SCENE");
  CLI::Option* const list =
      app.add_option("--list", options->list,
                     "Compare many scenes: a file with a reference and a current scene a line")
          ->type_name("FILE");
  app.add_option("--out", options->out,
                 "Result folder to write; with --list the folder of all results")
      ->required()
      ->type_name("RESULT");
  options->threads.AddTo(app);
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
  app.add_flag("--json", options->json, "Print result.json on the standard output")->excludes(list);
  app.footer("\nExit code 4 with the verdict no_answer: the result is written and states why.");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
