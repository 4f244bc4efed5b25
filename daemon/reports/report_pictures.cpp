// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/report_pictures.hpp"

#include <cmath>
#include <functional>
#include <optional>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "algo/base/errors.hpp"
#include "algo/render/error_image.hpp"
#include "algo/render/height_image.hpp"
#include "algo/render/overlay_image.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/loop/log.hpp"
#include "drivers/files/image_file.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// Result of `draw`; if it fails, the journal states why.
std::vector<cv::Mat> Drawn(const fs::path& folder,
                           const std::function<std::vector<cv::Mat>()>& draw) {
  try {
    return draw();
  } catch (const std::exception& error) {
    Log(LogLevel::kWarning, fmt::format("the report of scan {} is without pictures: {}",
                                        folder.filename().string(), error.what()));
    return {};
  }
}

std::vector<MapMark> MarksIn(const StoredResult& result, const SideWords& words) {
  if (!result.body) return {};
  const StoredBody& body = *result.body;
  const bool names_sides =
      body.named_by == BodyNames::kPosture && result.verdict != Verdict::kNoAnswer;
  std::optional<PatientAxes> patient;
  if (names_sides && body.head_xy && body.left_xy)
    patient = PatientAxes{*body.head_xy, *body.left_xy};
  std::optional<RoomWays> room;
  if (body.gantry_xy && body.right_xy) room = RoomWays{*body.gantry_xy, *body.right_xy};
  return MapMarks(patient, room, words);
}

Scene SceneWithHeights(const fs::path& scan_folder) {
  Scene scene =
      ReadScene(scan_folder / "scene", {.cloud = false, .height_map = true, .mesh = false});
  if (!scene.height_map) throw DataError("its scene has no height map");
  return scene;
}

HeightMap HeightsOf(const fs::path& scan_folder) {
  return std::move(*SceneWithHeights(scan_folder).height_map);
}

HeightMap MapLike(const HeightMap& heights, const fs::path& file) {
  const cv::Mat values = ReadFloatTiff(file);
  if (values.cols != heights.grid.width || values.rows != heights.grid.height)
    throw DataError(fmt::format("{} has another size than its reference", file.string()));
  HeightMap map(heights.grid);
  map.z.assign(values.begin<float>(), values.end<float>());
  return map;
}

/// Cells inside the region; empty if the result has no picture of it.
std::vector<std::uint8_t> RegionLike(const HeightMap& heights, const fs::path& file) {
  std::error_code ignored;
  if (!fs::exists(file, ignored)) return {};
  const cv::Mat picture = ReadColorImage(file);
  if (picture.cols != heights.grid.width || picture.rows != heights.grid.height)
    throw DataError(fmt::format("{} has another size than its reference", file.string()));
  std::vector<std::uint8_t> region;
  region.reserve(heights.grid.num_cells());
  for (const cv::Vec3b& cell : cv::Mat_<cv::Vec3b>(picture)) region.push_back(cell[0] != 0 ? 1 : 0);
  return region;
}

std::vector<std::uint8_t> PlannedRegion(const GridShape& grid, const ReferencePlan& plan) {
  if (plan.region_m.size() < 3) return {};
  std::vector<cv::Point> corners;
  for (const auto& [x, y] : plan.region_m)
    corners.emplace_back(static_cast<int>(std::lround((x - grid.x_min) / grid.step)),
                         static_cast<int>(std::lround((y - grid.y_min) / grid.step)));
  std::vector<std::uint8_t> region(grid.num_cells(), 0);
  cv::Mat mask(grid.height, grid.width, CV_8UC1, region.data());
  cv::fillPoly(mask, std::vector<std::vector<cv::Point>>{corners}, cv::Scalar(1));
  return region;
}

}  // namespace

std::vector<cv::Mat> ComparisonPictures(const fs::path& scan_folder,
                                        const fs::path& reference_folder,
                                        const std::optional<StoredResult>& result,
                                        double tolerance_m, const PictureWords& words,
                                        const SideWords& sides) {
  return Drawn(scan_folder, [&]() -> std::vector<cv::Mat> {
    const HeightMap reference = HeightsOf(reference_folder);
    const HeightMap deviation = MapLike(reference, scan_folder / "result/deviation.tiff");
    HeightMap current = deviation;
    for (std::size_t i = 0; i < current.z.size(); ++i) current.z[i] += reference.z[i];
    const std::vector<std::uint8_t> region =
        RegionLike(reference, scan_folder / "result/region.png");
    const std::vector<MapMark> marks = result ? MarksIn(*result, sides) : std::vector<MapMark>();
    return {
        DrawErrorImage(deviation, {.tolerance_m = tolerance_m,
                                   .relief = &reference,
                                   .region_mask = region,
                                   .marks = marks,
                                   .words = words}),
        DrawOverlayImage(
            reference, current,
            {.tolerance_m = tolerance_m, .region_mask = region, .marks = marks, .words = words})};
  });
}

PlanPictures ReferencePictures(const fs::path& scan_folder, const ReferencePlan& plan,
                               const RoomFinder& room_in, const PictureWords& words,
                               const SideWords& sides) {
  PlanPictures plans;
  plans.pictures = Drawn(scan_folder, [&]() -> std::vector<cv::Mat> {
    const Scene scene = SceneWithHeights(scan_folder);
    const HeightMap& heights = *scene.height_map;
    const std::optional<RoomWays> room = room_in ? room_in(scene.markers) : std::nullopt;
    const auto posture = Named<PatientPosture>(plan.posture);
    const std::vector<std::uint8_t> region = PlannedRegion(heights.grid, plan);
    HeightImageOptions options{.region_mask = region, .words = words};
    std::optional<PatientAxes> patient;
    if (room && posture) patient = SidesOf(*room, *posture);
    options.marks = MapMarks(patient, room, sides);
    if (plan.isocentre_m)
      options.isocentre_m = Eigen::Vector2d((*plan.isocentre_m)[0], (*plan.isocentre_m)[1]);
    std::vector<cv::Mat> pictures = {DrawHeightImage(heights, options)};
    plans.names_sides = patient.has_value();
    return pictures;
  });
  return plans;
}

}  // namespace plumb
