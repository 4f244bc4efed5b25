// SPDX-License-Identifier: Apache-2.0
#include "daemon/planning/planning_import.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "daemon/files/scene_folder.hpp"
#include "drivers/files/file_io.hpp"
#include "words/planning.hpp"
#include "words/scan.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// Copies a part of a file to one of its own.
/// @throws IoError, also if `from` is shorter.
void CopyPart(const fs::path& from, std::uint64_t offset, std::uint64_t bytes, const fs::path& to) {
  std::ifstream in(from, std::ios::binary);
  in.seekg(static_cast<std::streamoff>(offset));
  std::ofstream out(to, std::ios::binary | std::ios::trunc);
  std::vector<char> block(std::size_t{1} << 20);
  for (std::uint64_t left = bytes; left > 0 && in && out;) {
    const auto wanted = static_cast<std::streamsize>(std::min<std::uint64_t>(left, block.size()));
    in.read(block.data(), wanted);
    out.write(block.data(), in.gcount());
    left -= static_cast<std::uint64_t>(in.gcount());
  }
  out.close();
  if (!in || !out) throw IoError(DescribeWriteError(to, errno));
}

/// Where the plan ends, which begins behind the structure set.
std::uint64_t EndOfPlan(std::uint64_t sent_bytes, const SentParts& parts) {
  const std::uint64_t begin = parts.structures_bytes;
  const std::uint64_t end = parts.plan_bytes == 0 ? sent_bytes : begin + parts.plan_bytes;
  if (begin >= sent_bytes || end > sent_bytes || end <= begin)
    throw DataError(say::scan::PlanningTwoFiles());
  return end;
}

std::uint64_t SizeOf(const fs::path& file) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(file, error);
  return error ? 0 : size;
}

/// The size before an image.
std::uint64_t ReadSize(const fs::path& sent, std::uint64_t offset) {
  std::ifstream in(sent, std::ios::binary);
  in.seekg(static_cast<std::streamoff>(offset));
  std::array<char, 8> bytes{};
  if (!in.read(bytes.data(), bytes.size())) throw DataError(say::scan::PlanningImagesCut());
  std::uint64_t size = 0;
  for (std::size_t i = bytes.size(); i > 0; --i)
    size = size << 8U | static_cast<unsigned char>(bytes.at(i - 1));
  return size;
}

}  // namespace

ReadPlan ReadPlanning(const PlanningFiles& files, const PlanningChoice& choice) {
  const StructureSet structures = ReadStructureSet(files.structures, files.structures_name);
  const TreatmentPlan plan = ReadTreatmentPlan(files.plan, files.plan_name);
  return {.scene = MakePlannedScene(structures, plan, choice), .patient_id = plan.file.patient_id};
}

PlanningImages ImagesIn(std::vector<fs::path> paths, double threshold_hu, std::stop_token stop,
                        std::function<void(std::size_t)> progress) {
  const auto for_each = [paths = std::move(paths), stop = std::move(stop),
                         progress = std::move(progress)](const CtImageVisit& visit) {
    std::size_t count = 0;
    ForEachCtImage(paths, [&](const CtImage& image, const std::string& name) {
      CheckStop(stop);
      visit(image, name);
      if (progress) progress(++count);
    });
  };
  return {.for_each = for_each, .threshold_hu = threshold_hu};
}

ReadPlan ReadPlanningWithImages(const PlanningFiles& files, const PlanningImages& images,
                                const PlanningChoice& choice) {
  const TreatmentPlan plan = ReadTreatmentPlan(files.plan, files.plan_name);
  std::optional<StructureSet> drawn;
  if (!files.structures.empty()) drawn = ReadStructureSet(files.structures, files.structures_name);
  CtSkin skin(images.threshold_hu);
  double first_mm = std::numeric_limits<double>::infinity(), last_mm = -first_mm;
  images.for_each([&](const CtImage& image, const std::string& name) {
    skin.Add(image, name);
    first_mm = std::min(first_mm, image.origin_mm.z());
    last_mm = std::max(last_mm, image.origin_mm.z());
  });
  ReadPlan read{.scene = MakePlannedScene(drawn, plan, skin, choice),
                .patient_id = plan.file.patient_id};
  if (read.scene.planning->skin_threshold_hu) {  // otherwise a contour counts
    const bool are_named = drawn && skin.IsNamedBy(*drawn);
    const auto ends = are_named ? say::planning::ImagesAllNamed : say::planning::ImagesEnds;
    read.scene.warnings.push_back(
        ends(static_cast<std::int64_t>(skin.num_images()), first_mm, last_mm));
    if (drawn && skin.IsOfAnotherSeries(*drawn))
      read.scene.warnings.push_back(say::planning::ImagesOtherSeries());
  }
  return read;
}

CtImageVisit WithinTime(std::chrono::seconds most, const std::stop_token& stop,
                        CtImageVisit visit) {
  using Steady = std::chrono::steady_clock;
  return [most, stop, visit = std::move(visit), begin = Steady::now()](const CtImage& image,
                                                                       const std::string& name) {
    CheckStop(stop);
    if (Steady::now() - begin >= most)
      throw DataError(say::scan::PlanningTooSlow(std::chrono::duration<double>(most).count() / 60));
    visit(image, name);
  };
}

void CompareWithEarlierPlan(const fs::path& folder, Scene& scene) {
  if (!IsSceneFolder(folder)) return;
  try {
    const StoredScene before = ReadStoredScene(folder);
    if (before.scene.planning && before.scene.planning->plan_date > scene.planning->plan_date)
      scene.warnings.push_back(
          say::planning::OlderPlan(before.scene.planning->plan_date, scene.planning->plan_date));
  } catch (const DataError&) {
    // What cannot be read cannot be compared; it is replaced.
  }
}

void SplitPlanning(const fs::path& sent, const SentParts& parts, const PlanningFiles& to) {
  const std::uint64_t end = EndOfPlan(SizeOf(sent), parts);
  if (parts.structures_bytes > 0) CopyPart(sent, 0, parts.structures_bytes, to.structures);
  CopyPart(sent, parts.structures_bytes, end - parts.structures_bytes, to.plan);
}

void ForEachSentImage(const fs::path& sent, const SentParts& parts, const fs::path& scratch,
                      const CtImageVisit& visit) {
  const std::uint64_t all = SizeOf(sent);
  std::uint64_t at = EndOfPlan(all, parts);
  if (at == all) throw DataError(say::scan::PlanningNoImages());
  for (int number = 1; at < all; ++number) {
    const std::uint64_t size = ReadSize(sent, at);
    at += sizeof size;
    if (size == 0 || size > all - at) throw DataError(say::scan::PlanningImagesCut());
    CopyPart(sent, at, size, scratch);
    at += size;
    const std::string name = fmt::format("CT {}", number);
    const CtImage image = ReadCtImage(scratch, name);
    visit(image, name);
  }
  std::error_code ignored;
  fs::remove(scratch, ignored);
}

}  // namespace plumb
