// SPDX-License-Identifier: Apache-2.0
// Scans and what is kept of their results.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/base/names.hpp"
#include "algo/verdict/shown_row.hpp"
#include "web/model/check.hpp"
#include "web/model/numbers.hpp"
#include "web/model/reference.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

enum class ScanPurpose { kFraction, kReference, kDailyCheck };
template <>
inline constexpr auto kNamesOf<ScanPurpose> =
    NamesUpTo<ScanPurpose::kDailyCheck>({"fraction", "reference", "daily_check"});

enum class ScanOutcome { kRunning, kDone, kCancelled, kFailed };
template <>
inline constexpr auto kNamesOf<ScanOutcome> =
    NamesUpTo<ScanOutcome::kFailed>({"running", "done", "cancelled", "failed"});

/// Time for which a result is shown as actionable and can be accepted.
inline constexpr double kResultValid_s = 120.0;

/// Summary of a comparison, short enough for a list. All other data is in result.json.
struct ResultSummary {
  Verdict verdict = Verdict::kNoAnswer;
  std::vector<Message> reasons = {};
  /// The motion to APPLY. With kNoAnswer it is for analysis only, never to be shown as advice.
  std::optional<ReportedNumbers> correction = {};
  std::optional<ReportedNumbers> u95 = {};
  // In the order of kNumberAxes:
  std::array<Message, 6> words = {};  ///< Directions of the correction; empty if unknown.
  NumberJudgements judgements = {};
  std::array<Message, 6> axes = {};      ///< Their names; empty: along the couch.
  Message about = {};                    ///< The point about which the correction is stated.
  Tolerance tolerance = {};              ///< By which the numbers were judged.
  std::vector<Message> body_now = {};    ///< "left shoulder 9 mm high", before any correction.
  std::vector<Message> body_after = {};  ///< The same after the correction: the posture.
};

/// The six numbers for people; none without an answer, which must not be acted on.
[[nodiscard]] inline std::vector<ShownRow> ShownRows(const ResultSummary& result) {
  std::vector<ShownRow> rows;
  if (!result.correction || result.verdict == Verdict::kNoAnswer) return rows;
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
    const NumberAxis& axis = kNumberAxes[i];
    rows.push_back(
        {.name = result.axes[i].empty() ? AxisName(i) : result.axes[i],
         .number = i,
         .value = axis.In(result.correction),
         .u95 = axis.In(result.u95),
         .tolerance = axis.is_shift() ? result.tolerance.shift_mm : result.tolerance.rotation_deg,
         .judgement = result.judgements[i],
         .words = result.words[i]});
  }
  return rows;
}

struct Scan {
  std::string id;
  std::string patient_id;
  std::string reference_id;  ///< Reference of the comparison; empty if there is none.
  ScanPurpose purpose = ScanPurpose::kFraction;
  ScanOutcome outcome = ScanOutcome::kRunning;
  Message failure;  ///< Reason for a failed or cancelled scan.
  WallClock::time_point started_at;
  std::optional<WallClock::time_point> finished_at = {};
  std::optional<ResultSummary> result = {};
  std::string accepted_by;      ///< Empty if not accepted.
  std::string accepted_reason;  ///< Reason for acceptance outside tolerance.
  std::optional<WallClock::time_point> accepted_at = {};
  std::string session_id;  ///< Treatment session of the scan; empty if there is none.
  int fraction = 0;        ///< Fraction number of that session; 0 if there is none.
  /// Time that the sensor was on when the scan began, for warm-up.
  std::optional<double> sensor_on_s = {};
  DailyCheck daily_check = DailyCheck::kPassed;  ///< When the scan began.
  std::string sensor_serial = {};                ///< Names the unit that was swept.
  std::string session_by = {};  ///< Who opened its session; empty if there is none.
  /// Time since its end by a monotonic clock; not set if only the wall clock is available.
  std::optional<double> age_s = {};
  /// Of the last result: another sweep of its session has begun since, however that ended.
  bool is_superseded = false;
  std::filesystem::path folder =
      {};  ///< DIR/scans/ID; contains scene/, result/ and recording/ as far as they exist.
};

/// Whether every value was within tolerance, but not with its uncertainty.
[[nodiscard]] inline bool IsUnsure(const Scan& scan) {
  return scan.result && scan.result->verdict == Verdict::kUnsure;
}

}  // namespace plumb
