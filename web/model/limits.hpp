// SPDX-License-Identifier: Apache-2.0
// Limits of settings, plans and texts, used by requests, the appliance and the store. The page has
// its own copy in web/page/limits.js; a test compares them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "algo/base/posture.hpp"

namespace plumb {

struct Range {
  double least = 0.0, most = 0.0;

  /// Also false for a value that is not a number.
  [[nodiscard]] constexpr bool Holds(double value) const { return value >= least && value <= most; }
};

/// The values that a person may enter, and those that are accepted when they are read from the
/// store. The latter range is wider, so that a version that accepts less still reads what was
/// entered before, above all an approved plan. A value beyond it was not entered: the database was
/// changed or damaged.
struct Limits {
  Range entered, stored;
};

inline constexpr Limits kShiftTolerance_mm{.entered = {0.1, 50}, .stored = {0.001, 1000}};
inline constexpr Limits kRotationTolerance_deg{.entered = {0.1, 20}, .stored = {0.001, 180}};
/// Clothing and the breath of the CT, as a person states them of a planning CT.
inline constexpr Limits kStatedSurface_mm{.entered = {0, 30}, .stored = {0, 100}};
inline constexpr Limits kAutoStop_s{.entered = {1, 120}, .stored = {0.1, 3600}};
inline constexpr Limits kScanLimit_s{.entered = {5, 600}, .stored = {0.1, 3600}};
inline constexpr Limits kRetention_days{.entered = {0, 36500}, .stored = {0, 1'000'000}};
inline constexpr Limits kBreathWindow_mm{.entered = {1, 20}, .stored = {0.1, 100}};
inline constexpr Limits kIdleLogout_min{.entered = {1, 240}, .stored = {1, 100'000}};

/// Lengths of texts in bytes. A name is that of an account, a display, or a patient (its code).
inline constexpr std::size_t kMaxName = 32, kMaxSite = 64, kMaxNote = 500;
/// Photo of a set-up sheet, as JPEG.
inline constexpr std::size_t kMaxPhoto = std::size_t{160} << 10;
inline constexpr std::size_t kMaxDrawnPoints = 3000;
inline constexpr std::size_t kMinReason = 3, kMaxReason = 200;
/// Of a structure set and of a plan, each; a file of a planning CT is smaller.
inline constexpr std::uint64_t kMaxPlanningFile = std::uint64_t{64} << 20;
/// Of the images of a CT together, as they are sent.
inline constexpr std::uint64_t kMaxPlanningImages = std::uint64_t{1} << 30;
/// Hounsfield units of the skin in CT images.
inline constexpr double kMinSkinThreshold_hu = -900.0, kMaxSkinThreshold_hu = 0.0;
/// Name of a contour or a beam: the longest that DICOM permits, in bytes of UTF-8.
inline constexpr std::size_t kMaxPlanningName = 4 * 64;
inline constexpr int kMaxFraction = 999;
/// From what was scanned. One that is farther away was typed in another unit.
inline constexpr double kMostIsocentreAway_m = 0.5;

/// How a position that live monitoring shows is accepted: by a sweep that confirms it, or by a
/// person's signature on the live value.
inline constexpr std::string_view kBySweep = "sweep", kBySignature = "signature";

/// The papers of reports.
inline constexpr std::array<std::string_view, 2> kReportPapers = {"A4", "Letter"};

/// Head or feet first, supine or prone.
inline constexpr auto kPostures = kNamesOf<PatientPosture>;

[[nodiscard]] constexpr bool IsPosture(std::string_view text) {
  return Named<PatientPosture>(text).has_value();
}

[[nodiscard]] constexpr bool IsAcceptLive(std::string_view text) {
  return text == kBySweep || text == kBySignature;
}

[[nodiscard]] constexpr bool IsReportPaper(std::string_view text) {
  return text == kReportPapers[0] || text == kReportPapers[1];
}

}  // namespace plumb
