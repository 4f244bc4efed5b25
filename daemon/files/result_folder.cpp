#include "daemon/files/result_folder.hpp"

#include <bit>
#include <numeric>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "algo/render/error_image.hpp"
#include "algo/render/overlay_image.hpp"
#include "daemon/files/map_marks.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"

static_assert(std::endian::native == std::endian::little, "PLY is written as the bytes in memory");

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kResultFormat = 1;
constexpr double kSpokenHeight_m =
    3 * kMillimetre;  // smaller differences of a part are not reported in words
// Along the surface the field is interpolated from its surroundings, so small displacements are not
// reported.
constexpr double kSpokenShift_m = 8 * kMillimetre;
constexpr std::size_t kMaxResultBytes = std::size_t{16} << 20;

template <typename Derived>
Json MatrixJson(const Eigen::MatrixBase<Derived>& matrix) {
  Json rows = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    Json row = Json::array();
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) row.push_back(matrix(r, c));
    rows.push_back(std::move(row));
  }
  return rows;
}

template <typename Derived>
Json VectorJson(const Eigen::MatrixBase<Derived>& vector) {
  Json values = Json::array();
  for (Eigen::Index i = 0; i < vector.size(); ++i) values.push_back(vector(i));
  return values;
}

Json OptionalJson(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json AlignmentJson(const Alignment& alignment) {
  Json rejected = Json::object();
  for (const auto& [id, residual_m] : alignment.markers_rejected)
    rejected[std::to_string(id)] = residual_m;
  return {{"T_reference_current", MatrixJson(alignment.T_reference_current.matrix())},
          {"stretch", MatrixJson(alignment.stretch)},
          {"rms_m", alignment.rms_m},
          {"markers_used", alignment.markers_used},
          {"markers_rejected", rejected},
          {"covariance", MatrixJson(alignment.covariance)},
          {"centre_m", VectorJson(alignment.centre_m)}};
}

Json MotionJson(const BodyMotion& motion) {
  Json parts = Json::object();
  for (const auto& [cause, covariance] : motion.uncertainty.Parts()) {
    parts[cause] = MatrixJson(*covariance);
  }
  Json weak = Json::array();
  for (const WeakDirection& direction : motion.weak_directions) {
    weak.push_back(
        Json{{"name", direction.name}, {"u95", direction.u95}, {"unit", direction.unit}});
  }
  return {{"T", MatrixJson(motion.T.matrix())},
          {"covariance", MatrixJson(motion.covariance)},
          {"covariance_parts", std::move(parts)},
          {"weak_directions", weak},
          {"residual_m", {{"median", motion.residual_median_m}, {"p95", motion.residual_p95_m}}},
          {"centroid_m", VectorJson(motion.centroid_m)},
          {"inlier_share", motion.inlier_fraction}};
}

Json NumbersJson(const CouchNumbers& numbers) {
  return {{"vertical_mm", OptionalJson(numbers.vertical_mm)},
          {"longitudinal_mm", OptionalJson(numbers.longitudinal_mm)},
          {"lateral_mm", OptionalJson(numbers.lateral_mm)},
          {"pitch_deg", numbers.pitch_deg},
          {"roll_deg", numbers.roll_deg},
          {"yaw_deg", numbers.yaw_deg}};
}

Json RegionJson(const RegionCoverage& region, const AcceptanceLimits& limits) {
  return {{"coverage", region.coverage},
          {"largest_hole_m", region.largest_hole_m},
          {"hole_centre_m", VectorJson(region.hole_centre_m)},
          {"min_coverage", limits.min_coverage},
          {"max_hole_m", limits.max_hole_m}};
}

/// Every limit that decided about the verdict, so that a result states by what it was judged.
Json LimitsJson(const Comparison& comparison) {
  const AcceptanceLimits& limits = comparison.limits;
  return {{"shift_tolerance_mm", limits.shift_tolerance_m / kMillimetre},
          {"rotation_tolerance_deg", limits.rotation_tolerance_rad / kDegree},
          {"min_shared_markers", limits.min_shared_markers},
          {"moved_marker_mm", comparison.marker_consensus.moved_m / kMillimetre},
          {"moved_marker_sigmas", comparison.marker_consensus.moved_sigmas},
          {"min_coverage", limits.min_coverage},
          {"max_hole_mm", limits.max_hole_m / kMillimetre},
          {"max_residual_p95_mm", limits.max_residual_p95_m / kMillimetre},
          {"max_lost_s", limits.max_lost_s},
          {"max_breathing_mm", limits.max_breathing_m / kMillimetre}};
}

Json BodyPartsJson(const BodyParts& body) {
  Json parts = Json::array();
  const auto words = [](const BodyPart& part, const std::optional<double>& height_m) {
    const std::string text = height_m ? HeightWords(part, *height_m, kSpokenHeight_m) : "";
    return text.empty() ? Json(nullptr) : Json(text);
  };
  const bool has_sides = body.by_posture && body.patient;
  for (const BodyPart& part : body.parts) {
    const std::string shift =
        has_sides ? ShiftWords(part, *body.patient, kSpokenShift_m) : std::string();
    parts.push_back(Json{
        {"name", part.name},
        {"centre_m", VectorJson(part.centre_m)},
        {"now_mm", part.now_m ? Json(*part.now_m / kMillimetre) : Json(nullptr)},
        {"after_mm", part.after_m / kMillimetre},
        {"words_now", words(part, part.now_m)},
        {"words_after", words(part, part.after_m)},
        {"largest_shift_mm",
         part.largest_shift_m ? VectorJson(*part.largest_shift_m / kMillimetre) : Json(nullptr)},
        {"words_shift", shift.empty() ? Json(nullptr) : Json(shift)}});
  }
  const char* named_by = body.room ? "room" : "axes";
  Json json = {{"named_by", body.by_posture ? "posture" : named_by},
               {"room_known", body.room.has_value()},
               {"parts", parts}};
  if (body.patient) {
    json["head_xy"] = {body.patient->head.x(), body.patient->head.y()};
    json["left_xy"] = {body.patient->left.x(), body.patient->left.y()};
  }
  if (body.room) {
    json["gantry_xy"] = {body.room->gantry.x(), body.room->gantry.y()};
    json["right_xy"] = {body.room->right.x(), body.room->right.y()};
  }
  return json;
}

Json DeformationJson(const Deformation& deformation) {
  const auto observed =
      std::accumulate(deformation.observed.begin(), deformation.observed.end(), std::size_t{0});
  return {{"samples", deformation.points.size()},
          {"observed", observed},
          {"shift_mm",
           {{"median", deformation.shift_median_m / kMillimetre},
            {"p95", deformation.shift_p95_m / kMillimetre}}},
          {"residual_mm",
           {{"median", deformation.residual_median_m / kMillimetre},
            {"p95", deformation.residual_p95_m / kMillimetre}}}};
}

void WriteMap(const fs::path& file, const std::optional<HeightMap>& map) {
  if (!map || map->z.empty()) return;
  // The image borrows the values and is only read.
  WriteFloatTiff(file, cv::Mat(map->grid.height, map->grid.width, CV_32FC1,
                               const_cast<float*>(map->z.data())));
}

}  // namespace

Json CorrectionJson(const Correction& correction) {
  Json json = {{"isocentre", VectorJson(correction.isocentre_m)}};
  json.update(NumbersJson(correction.value));
  json["uncertainty"] = NumbersJson(correction.u95);
  for (std::size_t i = 0; i < kNumberNames.size(); ++i)
    json["words"][kNumberNames[i]] = correction.words[i];
  return json;
}

OutputKind ResultOutput() {
  return {"result",
          "result.json",
          {"result.json", "deviation.tiff", "distance.tiff", "deviation_after.tiff",
           "error_map.png", "overlay.png", "region.png", "deformation.ply"}};
}

std::string ResultJson(const Comparison& comparison, const std::optional<ResultRoom>& room) {
  Json json;
  json["format"] = kResultFormat;
  json["version"] = PLUMB_VERSION;
  json["preset"] = Name(comparison.preset);
  const auto named = [](const std::optional<std::string>& profile) {
    return profile ? Json(*profile) : Json(nullptr);
  };
  json["sensor_profiles"] = {{"reference", named(comparison.reference_profile)},
                             {"current", named(comparison.current_profile)}};
  json["verdict"] = Name(comparison.verdict);
  json["reasons"] = comparison.reasons;
  json["limits"] = LimitsJson(comparison);
  json["alignment"] = comparison.alignment ? AlignmentJson(*comparison.alignment) : Json(nullptr);
  json["motion"] = comparison.motion ? MotionJson(*comparison.motion) : Json(nullptr);
  json["correction"] =
      comparison.correction ? CorrectionJson(*comparison.correction) : Json(nullptr);
  json["region"] =
      comparison.region ? RegionJson(*comparison.region, comparison.limits) : Json(nullptr);
  json["body"] = comparison.body_parts ? BodyPartsJson(*comparison.body_parts) : Json(nullptr);
  json["deformation"] =
      comparison.deformation ? DeformationJson(*comparison.deformation) : Json(nullptr);
  if (room) {
    json["room_calibration"] = {{"version", room->version},
                                {"used", room->why_not_used.empty()},
                                {"why_not_used", room->why_not_used}};
  }
  json["warnings"] = comparison.warnings;
  json["timings_s"] = Json::object();
  for (const auto& [key, value] : comparison.timings_s) json["timings_s"][key] = value;
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
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
  WriteWholeFile(output.path() / "result.json", ResultJson(comparison, room));
  output.Commit();
}

std::string ReadResultJson(const fs::path& folder) {
  const fs::path file = folder / "result.json";
  std::string text = ReadTextFile(file, kMaxResultBytes);
  const Json json = ParseBoundedJsonOrNothing<Json>(text);
  if (!json.is_object() || !json.contains("format") || !json["format"].is_number_integer()) {
    throw DataError(fmt::format(
        "{} is not a result of plumb compare: expected a JSON object with a format; compare again",
        file.string()));
  }
  const auto format = json["format"].get<std::int64_t>();
  if (format != kResultFormat) {
    throw DataError(
        fmt::format("{} has format {}, this version reads format {}; update Plumb or compare again "
                    "with this version",
                    file.string(), format, kResultFormat));
  }
  return text;
}

bool IsResultFolder(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / "result.json", ignored);
}

}  // namespace plumb
