// SPDX-License-Identifier: Apache-2.0
// `plumb markers`: printable sheets.
#include <memory>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "daemon/cli/commands.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/sheets/marker_sheet.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct MarkersArguments {
  SheetOptions sheet;
  std::string ids = "0-15";
  fs::path out;
};

/// File of page `page`: FILE.svg, or FILE-01.svg and so on if there are several.
fs::path PageFile(const fs::path& out, int page, int num_pages) {
  if (num_pages == 1) return out;
  return out.parent_path() /
         fmt::format("{}-{:02}{}", out.stem().string(), page + 1, out.extension().string());
}

int Run(const MarkersArguments& options, const CommandContext& context) {
  SheetOptions sheet_options = options.sheet;
  sheet_options.language = &context.language;
  if (!sheet_options.is_board) sheet_options.ids = ParseIds(options.ids);
  const MarkerSheet sheet(sheet_options);
  std::string text;
  if (options.out.extension() == ".pdf") {
    WriteFileAtomically(options.out, [&](const fs::path& hidden) { sheet.WritePdf(hidden); });
    text = context.Said(say::cli::Sheets(options.out.string(), sheet.num_pages())) + "\n";
  } else {
    for (int page = 0; page < sheet.num_pages(); ++page) {
      const fs::path file = PageFile(options.out, page, sheet.num_pages());
      WriteFileAtomically(file, [&](const fs::path& hidden) { sheet.WriteSvg(hidden, page); });
      text += file.string() + "\n";
    }
  }
  PrintOut(text + context.Said(say::cli::PrintTrue()) + "\n");
  return kDone;
}

}  // namespace

Command AddMarkers(CLI::App& app) {
  auto options = std::make_shared<MarkersArguments>();
  CLI::Option* ids = app.add_option("--ids", options->ids, "Ids and ranges")
                         ->capture_default_str()
                         ->type_name("0-15,20");
  app.add_option("--dictionary", options->sheet.dictionary,
                 "OpenCV's name, or DICT_ARUCO_MIP_36h12")
      ->capture_default_str()
      ->type_name("NAME");
  app.add_option("--length", options->sheet.length_m, "Side of the black square, metres")
      ->capture_default_str()
      ->type_name("M");
  CLI::Option* paper =
      app.add_option("--paper", options->sheet.paper, "Paper size of the sheets, upright")
          ->check(CLI::IsMember({"A4", "A3", "Letter", "Tabloid"}))
          ->capture_default_str()
          ->type_name("A4|A3|Letter|Tabloid");
  app.add_flag("--board", options->sheet.is_board,
               "One sheet for the room's calibration: the dictionary's last four markers around a "
               "cross for the lasers; on A4 if it fits, otherwise on A3")
      ->excludes(ids)
      ->excludes(paper);
  app.add_option("--out", options->out, "File to write; SVG has one file per page")
      ->required()
      ->check([](const std::string& name) {
        const std::string extension = fs::path(name).extension().string();
        return extension == ".pdf" || extension == ".svg"
                   ? ""
                   : "expected a file that ends in .pdf or .svg";
      })
      ->type_name("FILE.pdf|FILE.svg");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
