// SPDX-License-Identifier: Apache-2.0
#include "daemon/planning/planning_import.hpp"

#include <cerrno>
#include <fstream>
#include <string>
#include <vector>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "daemon/files/scene_folder.hpp"
#include "drivers/dicom/planning_files.hpp"
#include "drivers/files/file_io.hpp"
#include "words/cli.hpp"
#include "words/scan.hpp"

namespace plumb {

namespace fs = std::filesystem;

ReadPlan ReadPlanning(const PlanningFiles& files, const PlanningChoice& choice) {
  const StructureSet structures = ReadStructureSet(files.structures, files.structures_name);
  const TreatmentPlan plan = ReadTreatmentPlan(files.plan, files.plan_name);
  return {.scene = MakePlannedScene(structures, plan, choice), .patient_id = plan.file.patient_id};
}

Scene ReadPlanningWithImages(const std::optional<fs::path>& structures, const fs::path& plan,
                             const std::vector<fs::path>& images, double threshold_hu,
                             const PlanningChoice& choice, const std::stop_token& stop,
                             const std::function<void(std::size_t)>& progress) {
  const TreatmentPlan planned = ReadTreatmentPlan(plan);
  std::optional<StructureSet> drawn;
  if (structures) drawn = ReadStructureSet(*structures);
  CtSkin skin(threshold_hu);
  ForEachCtImage(images, [&](const CtImage& image, const std::string& name) {
    CheckStop(stop);
    skin.Add(image, name);
    if (progress) progress(skin.num_images());
  });
  return MakePlannedScene(drawn, planned, skin, choice);
}

void CompareWithEarlierPlan(const fs::path& folder, Scene& scene) {
  if (!IsSceneFolder(folder)) return;
  try {
    const StoredScene before = ReadStoredScene(folder);
    if (before.scene.planning && before.scene.planning->plan_date > scene.planning->plan_date)
      scene.warnings.push_back(
          say::cli::OlderPlan(before.scene.planning->plan_date, scene.planning->plan_date));
  } catch (const DataError&) {
    // What cannot be read cannot be compared; it is replaced.
  }
}

void SplitPlanning(const fs::path& both, std::uint64_t structures_bytes, const fs::path& plan) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(both, error);
  if (error || structures_bytes == 0 || structures_bytes >= size)
    throw DataError(say::scan::PlanningTwoFiles());
  std::ifstream from(both, std::ios::binary);
  from.seekg(static_cast<std::streamoff>(structures_bytes));
  std::ofstream to(plan, std::ios::binary | std::ios::trunc);
  std::vector<char> block(std::size_t{1} << 20);
  for (std::uintmax_t left = size - structures_bytes; left > 0 && from && to;) {
    const auto wanted = static_cast<std::streamsize>(std::min<std::uintmax_t>(left, block.size()));
    from.read(block.data(), wanted);
    to.write(block.data(), from.gcount());
    left -= static_cast<std::uintmax_t>(from.gcount());
  }
  to.close();
  if (!from || !to) throw IoError(DescribeWriteError(plan, errno));
  fs::resize_file(both, structures_bytes, error);
  if (error) throw IoError(DescribeWriteError(both, error.value()));
}

}  // namespace plumb
