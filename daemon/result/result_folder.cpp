// SPDX-License-Identifier: Apache-2.0
#include "daemon/result/result_folder.hpp"

#include <bit>
#include <numeric>

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "algo/base/units.hpp"
#include "algo/render/error_image.hpp"
#include "algo/render/overlay_image.hpp"
#include "daemon/files/map_marks.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "words/output.hpp"

static_assert(std::endian::native == std::endian::little, "PLY is written as the bytes in memory");

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr double kSpokenHeight_m =
    3 * kMillimetre;  // smaller differences of a part are not reported in words
// Along the surface the field is interpolated from its surroundings, so small displacements are not
// reported.
constexpr double kSpokenShift_m = 8 * kMillimetre;
constexpr std::size_t kMaxResultBytes = std::size_t{16} << 20;

StoredNumbers NumbersOf(const CouchNumbers& numbers) {
  return {numbers.vertical_mm, numbers.longitudinal_mm, numbers.lateral_mm,
          numbers.pitch_deg,   numbers.roll_deg,        numbers.yaw_deg};
}

StoredAlignment Stored(const Alignment& alignment) {
  StoredAlignment stored{.T_reference_current = alignment.T_reference_current.matrix(),
                         .stretch = alignment.stretch,
                         .rms_m = alignment.rms_m,
                         .markers_used = alignment.markers_used,
                         .markers_rejected = {},
                         .covariance = alignment.covariance,
                         .centre_m = alignment.centre_m};
  for (const auto& [id, residual_m] : alignment.markers_rejected)
    stored.markers_rejected.emplace_back(std::to_string(id), residual_m);
  return stored;
}

StoredMotion Stored(const BodyMotion& motion) {
  StoredMotion stored{.T = motion.T.matrix(),
                      .covariance = motion.covariance,
                      .covariance_parts = {},
                      .weak_directions = {},
                      .residual_m = {motion.residual_median_m, motion.residual_p95_m},
                      .centroid_m = motion.centroid_m,
                      .inlier_share = motion.inlier_fraction};
  for (const auto& [cause, covariance] : motion.uncertainty.Parts())
    stored.covariance_parts.emplace_back(cause, *covariance);
  for (const WeakDirection& weak : motion.weak_directions)
    stored.weak_directions.push_back({weak.name, weak.u95, weak.unit});
  return stored;
}

StoredRegion Stored(const RegionCoverage& region, const AcceptanceLimits& limits) {
  return {.coverage = region.coverage,
          .largest_hole_m = region.largest_hole_m,
          .hole_centre_m = region.hole_centre_m,
          .min_coverage = limits.min_coverage,
          .max_hole_m = limits.max_hole_m};
}

StoredLimits LimitsOf(const Comparison& comparison) {
  const AcceptanceLimits& limits = comparison.limits;
  return {.shift_tolerance_mm = limits.shift_tolerance_m / kMillimetre,
          .rotation_tolerance_deg = limits.rotation_tolerance_rad / kDegree,
          .min_shared_markers = limits.min_shared_markers,
          .moved_marker_mm = comparison.marker_consensus.moved_m / kMillimetre,
          .moved_marker_sigmas = comparison.marker_consensus.moved_sigmas,
          .min_coverage = limits.min_coverage,
          .max_hole_mm = limits.max_hole_m / kMillimetre,
          .max_residual_p95_mm = limits.max_residual_p95_m / kMillimetre,
          .max_lost_s = limits.max_lost_s,
          .max_breathing_mm = limits.max_breathing_m / kMillimetre};
}

StoredBody Stored(const BodyParts& body) {
  StoredBody stored{.named_by = body.by_posture ? BodyNames::kPosture
                                : body.room     ? BodyNames::kRoom
                                                : BodyNames::kAxes,
                    .room_known = body.room.has_value(),
                    .parts = {},
                    .head_xy = {},
                    .left_xy = {},
                    .gantry_xy = {},
                    .right_xy = {}};
  for (const BodyPart& part : body.parts) {
    StoredBodyPart& made = stored.parts.emplace_back();
    made.name = part.name;
    made.centre_m = part.centre_m;
    if (part.now_m) {
      made.now_mm = *part.now_m / kMillimetre;
      made.words_now = HeightWords(part, *part.now_m, kSpokenHeight_m);
    }
    made.after_mm = part.after_m / kMillimetre;
    made.words_after = HeightWords(part, part.after_m, kSpokenHeight_m);
    if (part.largest_shift_m) made.largest_shift_mm = *part.largest_shift_m / kMillimetre;
    if (body.by_posture && body.patient)
      made.words_shift = ShiftWords(part, *body.patient, kSpokenShift_m);
  }
  if (body.patient) {
    stored.head_xy = body.patient->head;
    stored.left_xy = body.patient->left;
  }
  if (body.room) {
    stored.gantry_xy = body.room->gantry;
    stored.right_xy = body.room->right;
  }
  return stored;
}

StoredDeformation Stored(const Deformation& deformation) {
  return {
      .samples = static_cast<std::int64_t>(deformation.points.size()),
      .observed = std::accumulate(deformation.observed.begin(), deformation.observed.end(),
                                  std::int64_t{0}),
      .shift_mm = {deformation.shift_median_m / kMillimetre, deformation.shift_p95_m / kMillimetre},
      .residual_mm = {deformation.residual_median_m / kMillimetre,
                      deformation.residual_p95_m / kMillimetre}};
}

StoredReference Stored(const PlanningSource& planning) {
  return {.source = std::string(Name(SceneSource::kDicom)),
          .roi = planning.roi,
          .posture = std::string(Name(planning.posture)),
          .plan_label = planning.plan_label,
          .plan_date = planning.plan_date,
          .plan_uid = planning.plan_uid,
          .structure_set_uid = planning.structure_set_uid,
          .beam = planning.beam,
          .isocentre_lps_mm = planning.isocentre_mm,
          .skin_u95_mm = planning.skin_u95_m / kMillimetre,
          .slice_spacing_mm = planning.slice_spacing_m / kMillimetre,
          .skin_threshold_hu = planning.skin_threshold_hu,
          .clothing_mm = planning.surface.clothing_u95_m / kMillimetre,
          .ct_breathing_mm = planning.surface.ct_breathing_u95_m / kMillimetre};
}

void WriteMap(const fs::path& file, const std::optional<HeightMap>& map) {
  if (!map || map->z.empty()) return;
  // The image borrows the values and is only read.
  WriteFloatTiff(file, cv::Mat(map->grid.height, map->grid.width, CV_32FC1,
                               const_cast<float*>(map->z.data())));
}

}  // namespace

OutputKind ResultOutput() {
  return {say::output::Result(),
          "result.json",
          {"result.json", "deviation.tiff", "distance.tiff", "deviation_after.tiff",
           "error_map.png", "overlay.png", "region.png", "deformation.ply"}};
}

StoredResult Stored(const Comparison& comparison, const std::optional<ResultRoom>& room) {
  StoredResult stored;
  stored.version = PLUMB_VERSION;
  stored.preset = Name(comparison.preset);
  stored.sensor_profiles = {comparison.reference_profile, comparison.current_profile};
  if (comparison.planning) stored.compared_with = Stored(*comparison.planning);
  stored.verdict = comparison.verdict;
  stored.reasons = comparison.reasons;
  stored.limits = LimitsOf(comparison);
  if (comparison.alignment) stored.alignment = Stored(*comparison.alignment);
  if (comparison.motion) stored.motion = Stored(*comparison.motion);
  if (const auto& correction = comparison.correction) {
    stored.correction = StoredCorrection{.isocentre = correction->isocentre_m,
                                         .value = NumbersOf(correction->value),
                                         .u95 = NumbersOf(correction->u95),
                                         .words = correction->words,
                                         .judgements = comparison.judgements};
  }
  if (comparison.region) stored.region = Stored(*comparison.region, comparison.limits);
  if (comparison.body_parts) stored.body = Stored(*comparison.body_parts);
  if (comparison.deformation) stored.deformation = Stored(*comparison.deformation);
  if (room)
    stored.room_calibration = StoredRoom{.version = room->version,
                                         .used = room->why_not_used.empty(),
                                         .why_not_used = room->why_not_used};
  stored.warnings = comparison.warnings;
  stored.timings_s = comparison.timings_s;
  return stored;
}

namespace {

/// White for cells of the reference's grid in the region of interest.
void WriteRegion(const fs::path& file, const Comparison& comparison) {
  if (!comparison.deviation || comparison.region_mask.empty()) return;
  const GridShape& grid = comparison.deviation->grid;
  const cv::Mat mask(grid.height, grid.width, CV_8UC1,
                     const_cast<std::uint8_t*>(comparison.region_mask.data()));
  cv::Mat picture;
  cv::threshold(mask, picture, 0, 255, cv::THRESH_BINARY);
  WritePng(file, picture);
}

/// A binary PLY file with one vertex per sample: float x y z (reference frame, metres), float dx dy
/// dz (the displacement that remains after the rigid correction, metres), uchar observed (0: no
/// correspondence in the current scan).
void WriteDeformationPly(const fs::path& path, const Deformation& deformation) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment metres; d: what the rigid correction "
      "leaves\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "property float dx\nproperty float dy\nproperty float dz\nproperty uchar observed\n"
      "end_header\n",
      deformation.points.size());
  const auto append = [&](const Eigen::Vector3f& v) {
    bytes.append(reinterpret_cast<const char*>(v.data()), 3 * sizeof(float));
  };
  for (std::size_t i = 0; i < deformation.points.size(); ++i) {
    append(deformation.points[i]);
    append(deformation.shifts_m[i]);
    bytes.push_back(static_cast<char>(deformation.observed[i]));
  }
  WriteWholeFile(path, std::string_view(bytes));
}

}  // namespace

ResultPictures DrawResult(const Comparison& comparison, const HeightMap* reference_height,
                          const PictureOptions& options) {
  ResultPictures pictures;
  if (comparison.deviation) {
    ErrorImageOptions error;
    error.tolerance_m = options.tolerance_m;
    error.paper_colors = options.paper_colors;
    error.subtitle = options.subtitle;
    error.relief = reference_height;
    error.region_mask = comparison.region_mask;
    error.marks = MapMarks(comparison);
    pictures.error_map = DrawErrorImage(*comparison.deviation, error);
  }
  if (reference_height != nullptr && comparison.current_height) {
    OverlayImageOptions overlay;
    overlay.tolerance_m = options.tolerance_m;
    overlay.subtitle = options.subtitle;
    overlay.region_mask = comparison.region_mask;
    overlay.marks = MapMarks(comparison);
    pictures.overlay = DrawOverlayImage(*reference_height, *comparison.current_height, overlay);
  }
  return pictures;
}

void WriteResult(const Comparison& comparison, const ResultPictures& pictures,
                 const fs::path& folder, const std::optional<ResultRoom>& room) {
  AtomicFolder output(folder, ResultOutput());
  WriteMap(output.path() / "deviation.tiff", comparison.deviation);
  WriteMap(output.path() / "distance.tiff", comparison.distance);
  WriteMap(output.path() / "deviation_after.tiff", comparison.deviation_after);
  WriteRegion(output.path() / "region.png", comparison);
  if (comparison.deformation)
    WriteDeformationPly(output.path() / "deformation.ply", *comparison.deformation);
  if (!pictures.error_map.empty()) WritePng(output.path() / "error_map.png", pictures.error_map);
  if (!pictures.overlay.empty()) WritePng(output.path() / "overlay.png", pictures.overlay);
  WriteWholeFile(output.path() / "result.json", ResultText(Stored(comparison, room)));
  output.Commit();
}

StoredResult ReadResult(const fs::path& folder) {
  const fs::path file = folder / "result.json";
  return ParseResult(ReadTextFile(file, kMaxResultBytes), file.string());
}

bool IsResultFolder(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / "result.json", ignored);
}

}  // namespace plumb
