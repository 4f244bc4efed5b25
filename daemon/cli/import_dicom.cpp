// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "algo/planning/ct_skin.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/planning/planning_import.hpp"
#include "words/cli.hpp"
#include "words/text_report.hpp"
#include "words/web.hpp"

namespace plumb {
namespace {

struct ImportDicomArguments {
  std::vector<std::filesystem::path> files;  ///< Structure set and plan, or the plan alone.
  std::vector<std::filesystem::path> images;
  double threshold_hu = kSkinThreshold_hu;
  std::filesystem::path out;
  PlanningChoice choice;
  double clothing_mm = 0.0, ct_breathing_mm = 0.0;
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
  const auto& [clothing_u95_m, ct_breathing_u95_m] = planning.surface;
  if (clothing_u95_m > 0 || ct_breathing_u95_m > 0)
    text += context.Said(say::text_report::SurfaceStated(clothing_u95_m / kMillimetre,
                                                         ct_breathing_u95_m / kMillimetre)) +
            "\n";
  for (const Message& warning : scene.warnings)
    text += fmt::format("  {} {}\n", LeftAligned(context.Said(say::cli::WarningLabel()), 10),
                        context.Said(warning));
  return text;
}

Scene Read(const ImportDicomArguments& options, const std::stop_token& stop, Progress& progress) {
  PlanningFiles files{.structures = {}, .plan = options.files.back()};
  if (options.files.size() > 1) files.structures = options.files.front();
  if (options.images.empty()) return ReadPlanning(files, options.choice).scene;
  const PlanningImages images =
      ImagesIn(options.images, options.threshold_hu, stop, [&](std::size_t count) {
        // How many there will be is not known.
        progress.Update(say::cli::ReadingDicom(),
                        0.8 * static_cast<double>(count) / (static_cast<double>(count) + 100.0));
      });
  return ReadPlanningWithImages(files, images, options.choice).scene;
}

/// Also refuses what is not a number.
double Stated_m(const char* option, double value_mm) {
  constexpr double kMost_mm = kMostStated_m / kMillimetre;
  if (value_mm >= 0 && value_mm <= kMost_mm) return value_mm * kMillimetre;
  throw InvalidRequest(say::web::FieldRange(option, 0, kMost_mm, value_mm));
}

int Run(const ImportDicomArguments& options, const CommandContext& context) {
  const StatedSurface stated{
      .clothing_u95_m = Stated_m("--clothing-mm", options.clothing_mm),
      .ct_breathing_u95_m = Stated_m("--ct-breathing-mm", options.ct_breathing_mm)};
  if (options.files.size() < 2 && options.images.empty())
    throw InvalidRequest(say::cli::StructuresOrImages());
  { const AtomicFolder check(options.out, SceneOutput()); }  // rejects a bad place before the work
  Progress progress(context.language);
  progress.Update(say::cli::ReadingDicom(), 0.1);
  Scene scene = Read(options, context.stop, progress);
  scene.planning->surface = stated;
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
  app.add_option("files", options->files,
                 "DICOM RT Structure Set with the contours, and the RT Plan made on it with "
                 "isocentre and position; with --images the plan alone may do")
      ->required()
      ->expected(1, 2)
      ->type_name("[STRUCTURES] PLAN");
  CLI::Option* const images =
      app.add_option("--images", options->images,
                     "Folder of CT images, or one of them; may be repeated. The skin is taken from "
                     "them where the structure set has no external contour")
          ->expected(1)
          ->allow_extra_args(false)  // what follows is the plan
          ->take_all()
          ->type_name("CT");
  app.add_option("--threshold", options->threshold_hu, "Hounsfield units of the skin in the images")
      ->needs(images)
      ->check(CLI::Range(kLeastSkinThreshold_hu, kMostSkinThreshold_hu))
      ->capture_default_str()
      ->type_name("HU");
  app.add_option("--out", options->out, "Scene folder to write")->required()->type_name("SCENE");
  app.add_option("--roi", options->choice.roi,
                 "The contour that is the skin, where the structure set does not say it")
      ->type_name("NAME");
  app.add_option("--isocentre-of", options->choice.beam,
                 "Name or number of the beam whose isocentre counts, where they differ")
      ->type_name("BEAM");
  app.add_option("--clothing-mm", options->clothing_mm,
                 "How far the surface that the camera sees may lie from the skin of the CT along "
                 "its normal, by what is worn at either: half-width of the 95 % interval, 0 to 30")
      ->capture_default_str()
      ->type_name("MM");
  app.add_option("--ct-breathing-mm", options->ct_breathing_mm,
                 "How much higher or lower chest and belly may be than in the breath of the CT: "
                 "half-width of the 95 % interval, 0 to 30")
      ->capture_default_str()
      ->type_name("MM");
  app.add_flag("--json", options->json, "Print scene.json on the standard output");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
