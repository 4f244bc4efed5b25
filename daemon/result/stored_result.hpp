// SPDX-License-Identifier: Apache-2.0
// result.json as a type. Each part names its fields once, in Fields(), for the writer and the
// reader: a field that is added there is written, read and checked.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/verdict/gates.hpp"

namespace plumb {

// A number that is not finite is written as null and read back as NaN. An optional value may be
// null or missing: it is then not known. Anything else must be there.

/// The six numbers in the order of kNumberNames, in mm and degrees; not set where not known.
using StoredNumbers = std::array<std::optional<double>, 6>;

struct StoredAlignment {
  Eigen::Matrix4d T_reference_current = Eigen::Matrix4d::Identity();
  Eigen::Matrix3d stretch = Eigen::Matrix3d::Identity();
  double rms_m = 0.0;  ///< NaN (null in the file): no markers were fitted to each other.
  std::vector<int> markers_used;
  std::vector<std::pair<std::string, double>> markers_rejected;  ///< Residual (m) by id.
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();

  static void Fields(auto& self, const auto& visit) {
    visit("T_reference_current", self.T_reference_current);
    visit("stretch", self.stretch);
    visit("rms_m", self.rms_m);
    visit("markers_used", self.markers_used);
    visit("markers_rejected", self.markers_rejected);
    visit("covariance", self.covariance);
    visit("centre_m", self.centre_m);
  }
};

struct StoredSpread {
  double median = 0.0, p95 = 0.0;

  static void Fields(auto& self, const auto& visit) {
    visit("median", self.median);
    visit("p95", self.p95);
  }
};

struct StoredWeakDirection {
  std::string name;
  double u95 = 0.0;
  std::string unit;

  static void Fields(auto& self, const auto& visit) {
    visit("name", self.name);
    visit("u95", self.u95);
    visit("unit", self.unit);
  }
};

struct StoredMotion {
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  Matrix6d covariance = Matrix6d::Zero();
  std::vector<std::pair<std::string, Matrix6d>> covariance_parts;  ///< By cause.
  std::vector<StoredWeakDirection> weak_directions;
  StoredSpread residual_m;
  Eigen::Vector3d centroid_m = Eigen::Vector3d::Zero();
  double inlier_share = 0.0;

  static void Fields(auto& self, const auto& visit) {
    visit("T", self.T);
    visit("covariance", self.covariance);
    visit("covariance_parts", self.covariance_parts);
    visit("weak_directions", self.weak_directions);
    visit("residual_m", self.residual_m);
    visit("centroid_m", self.centroid_m);
    visit("inlier_share", self.inlier_share);
  }
};

/// The motion to apply.
struct StoredCorrection {
  Eigen::Vector3d isocentre = Eigen::Vector3d::Zero();
  StoredNumbers value{}, u95{};
  std::array<Message, 6> words;   ///< Directions; empty where not reported.
  NumberJudgements judgements{};  ///< Decided with the verdict; by the reader for older records.

  static void Fields(auto& self, const auto& visit) {
    visit("isocentre", self.isocentre);
    visit.Numbers(self.value);
    visit("uncertainty", self.u95);
    visit.NumberWords("words", "word_messages", self.words);
    visit("judgements", self.judgements);
  }
};

struct StoredRegion {
  double coverage = 0.0, largest_hole_m = 0.0;
  Eigen::Vector2d hole_centre_m = Eigen::Vector2d::Zero();
  double min_coverage = 0.0, max_hole_m = 0.0;

  static void Fields(auto& self, const auto& visit) {
    visit("coverage", self.coverage);
    visit("largest_hole_m", self.largest_hole_m);
    visit("hole_centre_m", self.hole_centre_m);
    visit("min_coverage", self.min_coverage);
    visit("max_hole_m", self.max_hole_m);
  }
};

/// All that decided about the verdict.
struct StoredLimits {
  double shift_tolerance_mm = 0.0, rotation_tolerance_deg = 0.0;
  int min_shared_markers = 0;
  double moved_marker_mm = 0.0, moved_marker_sigmas = 0.0;
  double min_coverage = 0.0, max_hole_mm = 0.0, max_residual_p95_mm = 0.0;
  double max_lost_s = 0.0, max_breathing_mm = 0.0;

  static void Fields(auto& self, const auto& visit) {
    visit("shift_tolerance_mm", self.shift_tolerance_mm);
    visit("rotation_tolerance_deg", self.rotation_tolerance_deg);
    visit("min_shared_markers", self.min_shared_markers);
    visit("moved_marker_mm", self.moved_marker_mm);
    visit("moved_marker_sigmas", self.moved_marker_sigmas);
    visit("min_coverage", self.min_coverage);
    visit("max_hole_mm", self.max_hole_mm);
    visit("max_residual_p95_mm", self.max_residual_p95_mm);
    visit("max_lost_s", self.max_lost_s);
    visit("max_breathing_mm", self.max_breathing_mm);
  }
  [[nodiscard]] double ToleranceOf(std::size_t number) const {
    return IsShift(number) ? shift_tolerance_mm : rotation_tolerance_deg;
  }
};

struct StoredBodyPart {
  Message name;
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  std::optional<double> now_mm;
  double after_mm = 0.0;
  std::optional<Eigen::Vector3d> largest_shift_mm;
  Message words_now, words_after, words_shift;  ///< Empty where there is nothing to say.

  static void Fields(auto& self, const auto& visit) {
    visit("name", self.name);
    visit("centre_m", self.centre_m);
    visit("now_mm", self.now_mm);
    visit("after_mm", self.after_mm);
    visit("largest_shift_mm", self.largest_shift_mm);
    visit("words_now", self.words_now);
    visit("words_after", self.words_after);
    visit("words_shift", self.words_shift);
  }
};

enum class BodyNames : std::uint8_t { kPosture, kRoom, kAxes };
template <>
inline constexpr auto kNamesOf<BodyNames> = NamesUpTo<BodyNames::kAxes>({"posture", "room",
                                                                         "axes"});

struct StoredBody {
  BodyNames named_by = BodyNames::kAxes;
  bool room_known = false;
  std::vector<StoredBodyPart> parts;
  /// In the plane of the reference marker; read as unit vectors.
  std::optional<Eigen::Vector2d> head_xy, left_xy, gantry_xy, right_xy;

  static void Fields(auto& self, const auto& visit) {
    visit("named_by", self.named_by);
    visit("room_known", self.room_known);
    visit("parts", self.parts);
    visit.IfSet("head_xy", self.head_xy);
    visit.IfSet("left_xy", self.left_xy);
    visit.IfSet("gantry_xy", self.gantry_xy);
    visit.IfSet("right_xy", self.right_xy);
  }
};

struct StoredDeformation {
  std::int64_t samples = 0, observed = 0;
  StoredSpread shift_mm, residual_mm;

  static void Fields(auto& self, const auto& visit) {
    visit("samples", self.samples);
    visit("observed", self.observed);
    visit("shift_mm", self.shift_mm);
    visit("residual_mm", self.residual_mm);
  }
};

struct StoredRoom {
  int version = 0;
  bool used = false;
  Message why_not_used;

  static void Fields(auto& self, const auto& visit) {
    visit("version", self.version);
    visit("used", self.used);
    visit.Text("why_not_used", self.why_not_used);
  }
};

/// What a reference was made of, unless a sweep.
struct StoredReference {
  std::string source, roi, posture, plan_label, plan_date, plan_uid, structure_set_uid, beam;
  Eigen::Vector3d isocentre_lps_mm = Eigen::Vector3d::Zero();
  double skin_u95_mm = 0.0, slice_spacing_mm = 0.0;
  /// Of CT images; not set: a contour was the surface.
  std::optional<double> skin_threshold_hu = {};
  double clothing_mm = 0.0, ct_breathing_mm = 0.0;  ///< As stated: see StatedSurface.

  static void Fields(auto& self, const auto& visit) {
    visit("source", self.source);
    visit("roi", self.roi);
    visit("posture", self.posture);
    visit("plan_label", self.plan_label);
    visit("plan_date", self.plan_date);
    visit("plan_uid", self.plan_uid);
    visit("structure_set_uid", self.structure_set_uid);
    visit("beam", self.beam);
    visit("isocentre_lps_mm", self.isocentre_lps_mm);
    visit("skin_u95_mm", self.skin_u95_mm);
    visit("slice_spacing_mm", self.slice_spacing_mm);
    visit.IfSet("skin_threshold_hu", self.skin_threshold_hu);
    visit.OrAsIs("clothing_mm", self.clothing_mm);
    visit.OrAsIs("ct_breathing_mm", self.ct_breathing_mm);
  }
};

struct StoredProfiles {
  std::optional<std::string> reference, current;

  static void Fields(auto& self, const auto& visit) {
    visit("reference", self.reference);
    visit("current", self.current);
  }
};

struct StoredResult {
  static constexpr int kFormat = 1;

  std::string version, preset;
  StoredProfiles sensor_profiles;
  std::optional<StoredReference> compared_with;  ///< Not set: the scene of a sweep.
  Verdict verdict = Verdict::kNoAnswer;
  std::vector<Message> reasons;
  StoredLimits limits;
  std::optional<StoredAlignment> alignment;
  std::optional<StoredMotion> motion;
  std::optional<StoredCorrection> correction;
  std::optional<StoredRegion> region;
  std::optional<StoredBody> body;
  std::optional<StoredDeformation> deformation;
  std::optional<StoredRoom> room_calibration;
  std::vector<Message> warnings;
  std::map<std::string, double> timings_s;

  static void Fields(auto& self, const auto& visit) {
    visit("version", self.version);
    visit("preset", self.preset);
    visit("sensor_profiles", self.sensor_profiles);
    visit.IfSet("compared_with", self.compared_with);
    visit("verdict", self.verdict);
    visit.Sentences("reasons", "reason_messages", self.reasons);
    visit("limits", self.limits);
    visit("alignment", self.alignment);
    visit("motion", self.motion);
    visit("correction", self.correction);
    visit("region", self.region);
    visit("body", self.body);
    visit("deformation", self.deformation);
    visit.IfSet("room_calibration", self.room_calibration);
    visit.Sentences("warnings", "warning_messages", self.warnings);
    visit("timings_s", self.timings_s);
  }
};

/// The text of result.json. The same result gives the same bytes, and reads back bit for bit.
[[nodiscard]] std::string ResultText(const StoredResult& result);

/// Reads what this version or 0.2.0 wrote. Judgements that are missing are decided by the numbers
/// and limits of the result.
/// @param name  Of the file, for messages.
/// @throws DataError naming the field, what was expected and what was found; also if the verdict or
///         a judgement contradicts the numbers.
[[nodiscard]] StoredResult ParseResult(std::string_view text, const std::string& name);

/// Whether the correction is stated about the middle of the region, as where no isocentre is known.
[[nodiscard]] inline bool IsAboutMiddle(const StoredResult& result) {
  return result.motion && result.correction &&
         result.correction->isocentre == result.motion->centroid_m;
}

/// A correction alone, as the control socket sends it.
[[nodiscard]] nlohmann::ordered_json CorrectionJson(const StoredCorrection& correction);
/// @throws DataError
[[nodiscard]] StoredCorrection ParseCorrection(const nlohmann::ordered_json& json);

}  // namespace plumb
