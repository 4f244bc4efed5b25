// SPDX-License-Identifier: Apache-2.0
// Decides whether the numbers of a comparison may be acted on: all gates, their limits, and the
// verdict.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/base/units.hpp"
#include "algo/verdict/default_tolerance.hpp"
#include "algo/verdict/number_judgement.hpp"
#include "algo/verdict/verdict.hpp"

namespace plumb {

/// Limits of the gates. They apply to every preset: a preset chooses how numbers are made, never
/// whether they may be shown as an answer.
struct AcceptanceLimits {
  /// For each of the three shifts, and of the three rotations.
  double shift_tolerance_m = kDefaultShiftTolerance_mm * kMillimetre;
  double rotation_tolerance_rad = kDefaultRotationTolerance_deg * kDegree;

  int min_shared_markers = 3;  ///< With fewer markers that did not move there is no answer.
  double min_coverage = 0.9;   ///< Fraction of the region measured by the scan.
  double max_hole_m = 5 * kCentimetre;           ///< Largest hole in the region, as a diameter.
  double max_residual_p95_m = 25 * kMillimetre;  ///< 95th percentile after the best motion.
  double max_lost_s = 1.0;                       ///< Longest time without tracking in each scan.
  /// Largest rise of chest and belly in each scan. The uncertainty was measured up to this rise.
  double max_breathing_m = 8 * kMillimetre;
};

/// Beyond these a gate would refuse nothing any more. Experiments may go so far; an appliance takes
/// no limit that is looser than the default. The tolerances are those of a plan: their bounds only
/// exclude what is no tolerance.
inline constexpr AcceptanceLimits kLoosestLimits{.shift_tolerance_m = 1.0,
                                                 .rotation_tolerance_rad = 180 * kDegree,
                                                 .min_shared_markers = 1,
                                                 .min_coverage = 0.5,
                                                 .max_hole_m = 0.3,
                                                 .max_residual_p95_m = 100 * kMillimetre,
                                                 .max_lost_s = 10.0,
                                                 .max_breathing_m = 50 * kMillimetre};

/// @throws std::invalid_argument naming a limit that is not positive, or looser than that of
///         kLoosestLimits.
void CheckLimits(const AcceptanceLimits& limits);

/// The six numbers in the order used by results: vertical, longitudinal, lateral, pitch, roll, yaw.
inline constexpr std::array<const char*, 6> kNumberNames = {"vertical", "longitudinal", "lateral",
                                                            "pitch",    "roll",         "yaw"};
[[nodiscard]] constexpr bool IsShift(std::size_t number) { return number < 3; }
[[nodiscard]] constexpr const char* UnitOf(std::size_t number) {
  return IsShift(number) ? "mm" : "deg";
}

/// Whether the markers of two scans lie so differently that a distorted scan is as likely a cause
/// of a misfit as another body. Scans of one room by good units fit to 0.3 to 1.9 mm (RMS, 288
/// pairs of four classes); halves of a real sweep with a wrong calibration fit to 3.5 mm.
/// @param rms_m  NaN: not known, and nothing disagrees.
[[nodiscard]] bool MarkersDisagree(double rms_m);

/// The name of one of the six numbers, for people.
[[nodiscard]] Message NumberWord(std::size_t number);

/// Tolerance of one of the six numbers, in its unit.
[[nodiscard]] double ToleranceOf(const AcceptanceLimits& limits, std::size_t number);

/// One of the six numbers in mm or degrees.
struct MeasuredNumber {
  double value = 0.0;
  double u95 = 0.0;  ///< 95 % half-width.
  Message words;     ///< Direction, such as "up"; used in the reason.
};

/// In the order of kNumberNames.
using NumberJudgements = std::array<NumberJudgement, 6>;

/// The verdict of numbers that no gate refuses: move if one is outside its tolerance, in_tolerance
/// if each is surely within it.
/// @param is_reported  Whether there is such a number; others have no say.
[[nodiscard]] Verdict VerdictOf(const NumberJudgements& judgements,
                                const std::array<bool, 6>& is_reported);

/// Agreement of the markers that both scans saw.
struct MarkerEvidence {
  std::vector<int> shared_ids;  ///< Ids of all markers that both scans saw, ascending.
  int good = 0;                 ///< Number of markers that agree with each other.
  std::vector<int> moved_used;  ///< Markers that moved but are used by the alignment (`paper`).
  bool two_groups = false;      ///< Two groups of equal size disagree.
};

/// Input of all gates. A quantity that could not be computed stays NaN or absent, and the gate that
/// needs it refuses.
struct Evidence {
  /// Why the comparison ended before there was anything to judge; empty if
  /// it was completed. This refusal comes first.
  Message failure;

  /// Why there is no answer whatever the numbers are, such as a scan that must not be compared.
  /// They come before the gates' own reasons, which are often only their symptoms.
  std::vector<Message> refusals;

  MarkerEvidence markers;
  bool reference_has_support = false;  ///< A couch or floor was found beneath the body.
  bool region_is_drawn = false;  ///< True if a person drew it, false if the body was segmented.

  double coverage = kNotMeasured;
  double largest_hole_m = kNotMeasured;
  Message hole_place;  ///< The part of the body that it lies on, such as "left shoulder".
  double residual_p95_m = kNotMeasured;
  /// RMS misfit of the two marker maps after the alignment.
  double markers_rms_m = kNotMeasured;
  double reference_lost_s = kNotMeasured;
  double current_lost_s = kNotMeasured;
  /// Rise of chest and belly; 0 also where it is not known, as in scans of older versions.
  double reference_breathing_m = 0.0;
  double current_breathing_m = 0.0;

  /// Absent where not reported, as shifts with couch-fixed markers.
  std::array<std::optional<MeasuredNumber>, 6> numbers;
  /// What makes shifts and rotations uncertain most of all; said where one is too uncertain.
  Message shift_doubt, turn_doubt;
  /// How well the scans know their own markers: mean SceneMarker::sigma_m. The scan that knows them
  /// much worse is named where a number is too uncertain.
  double reference_markers_sigma_m = kNotMeasured;
  double current_markers_sigma_m = kNotMeasured;

  static constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();
};

struct Decision {
  Verdict verdict = Verdict::kNoAnswer;
  std::vector<Message> reasons;  ///< Complete sentences, the most important first; never empty.
  NumberJudgements numbers{};    ///< Also without an answer, as far as they are known.
};

/// Refusals of the marker gates; empty if they pass.
[[nodiscard]] std::vector<Message> RefusalsOfMarkers(const MarkerEvidence& markers,
                                                     int min_shared_markers);

/// The verdict: no_answer if any gate refuses, in the order refused scans, markers, support,
/// coverage, hole, residual, tracking, breathing, uncertainty; move if a value lies outside its
/// tolerance; unsure if a value plus its uncertainty does; otherwise in_tolerance. A value at a
/// limit is within it.
///
/// A pure function of its input. Rotations are always needed, shifts only where they are present.
[[nodiscard]] Decision Decide(const Evidence& evidence, const AcceptanceLimits& limits);

}  // namespace plumb
