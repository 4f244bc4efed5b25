// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/units.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/planning/planning_import.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

struct ImportDicomArguments {
  std::filesystem::path structures, plan, out;
  PlanningChoice choice;
  bool json = false;
};

std::string BoxOf(const Scene& scene) {
  std::string text;
  for (int axis = 0; axis < 3; ++axis) {
    float low = std::numeric_limits<float>::max(), high = -low;
    for (const Eigen::Vector3f& p : scene.cloud.points) {
      low = std::min(low, p[axis]);
      high = std::max(high, p[axis]);
    }
    text += fmt::format("{}{} {:.1f}..{:.1f}", axis == 0 ? "" : ", ", "XYZ"[axis],
                        low / kMillimetre, high / kMillimetre);
  }
  return text;
}

std::string TextOf(const Scene& scene, const ImportDicomArguments& options,
                   const CommandContext& context) {
  const PlanningSource& planning = *scene.planning;
  const Eigen::Vector3d& p = planning.isocentre_mm;
  std::string text =
      context.Said(say::cli::PlanImported(
          options.out.string(), planning.roi, planning.slices,
          planning.slice_spacing_m / kMillimetre, std::string(Name(planning.posture)),
          fmt::format("({:.3f}, {:.3f}, {:.3f})", p.x(), p.y(), p.z()))) +
      "\n";
  const auto cells = std::count_if(scene.height_map->z.begin(), scene.height_map->z.end(),
                                   [](float z) { return std::isfinite(z); });
  text += context.Said(
              say::cli::PlanBox(BoxOf(scene), cells, scene.height_map->grid.step / kMillimetre)) +
          "\n";
  for (const Message& warning : scene.warnings)
    text += fmt::format("  {} {}\n", LeftAligned(context.Said(say::cli::WarningLabel()), 10),
                        context.Said(warning));
  return text;
}

int Run(const ImportDicomArguments& options, const CommandContext& context) {
  { const AtomicFolder check(options.out, SceneOutput()); }  // rejects a bad place before the work
  Progress progress(context.language);
  progress.Update(say::cli::ReadingDicom(), 0.1);
  Scene scene = ReadPlanning({options.structures, options.plan}, options.choice).scene;
  CompareWithEarlierPlan(options.out, scene);
  progress.Update(say::cli::Writing(), 0.9);
  WriteScene(scene, options.out, context.stop);
  progress.Clear();
  PrintOut(options.json ? SceneText(options.out) : TextOf(scene, options, context));
  return kDone;
}

}  // namespace

Command AddImportDicom(CLI::App& app) {
  auto options = std::make_shared<ImportDicomArguments>();
  app.add_option("structures", options->structures, "DICOM RT Structure Set with the contours")
      ->required()
      ->type_name("STRUCTURES");
  app.add_option("plan", options->plan, "DICOM RT Plan made on it: isocentre and position")
      ->required()
      ->type_name("PLAN");
  app.add_option("--out", options->out, "Scene folder to write")->required()->type_name("SCENE");
  app.add_option("--roi", options->choice.roi,
                 "The contour that is the skin, where the structure set does not say it")
      ->type_name("NAME");
  app.add_option("--isocentre-of", options->choice.beam,
                 "Name or number of the beam whose isocentre counts, where they differ")
      ->type_name("BEAM");
  app.add_flag("--json", options->json, "Print scene.json on the standard output");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
