// SPDX-License-Identifier: Apache-2.0
// The treatment couch of the room: which of the six numbers it can apply, and how its own display
// counts them. Everything that shows a correction or a live motion asks CouchAxisOf().
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/verdict/shown_row.hpp"
#include "web/model/numbers.hpp"
#include "web/model/scan.hpp"
#include "web/model/wall_clock.hpp"
#include "words/result.hpp"

namespace plumb {

/// Never changes a verdict, a direction in words or an arrow: those are of the body. What is kept
/// (lists, trends, statistics, files) stays in millimetres and the axes of IEC 61217.
struct CouchProfile {
  int version = 0;        ///< 0: none was signed; then a couch of six axes counts as IEC 61217.
  std::string name = {};  ///< As people call it.
  int num_axes = 6;       ///< 3: the shifts; 4: the turn about the vertical as well; 6: all.
  bool is_in_cm = false;
  std::array<bool, 6> reverses = {};  ///< In the order of kNumberAxes: counts against IEC 61217.
  /// Leaves out what the couch cannot apply while that is in tolerance.
  bool hides_rest = false;
  /// Its display has no readings below zero: 995 cm stands for -5 cm, 359 degrees for -1.
  bool wraps = false;
  std::string signed_by = {};
  WallClock::time_point signed_at = {};
};

[[nodiscard]] inline bool IsCouchAxes(int num_axes) {
  return num_axes == 3 || num_axes == 4 || num_axes == 6;
}

/// One of the six as the couch counts it.
struct CouchAxis {
  double factor = 1.0;  ///< From the number's own unit along IEC 61217.
  const char* unit = "mm";
  int digits = 1;  ///< Behind the point, at most.
  bool moves = true;
  std::optional<double> period = {};  ///< Where readings begin at zero again; not of a correction.
};

/// As it follows a number: no space before the sign of degrees.
[[nodiscard]] inline std::string UnitBehind(const CouchAxis& axis) {
  return (*axis.unit == 'm' || *axis.unit == 'c' ? " " : "") + std::string(axis.unit);
}

[[nodiscard]] inline CouchAxis CouchAxisOf(const CouchProfile& couch, std::size_t number) {
  const NumberAxis& axis = kNumberAxes.at(number);
  const double sign = couch.reverses.at(number) ? -1.0 : 1.0;
  constexpr std::size_t kYaw = 5;
  const bool moves =
      axis.is_shift() || couch.num_axes == 6 || (couch.num_axes == 4 && number == kYaw);
  const auto period = [&](double at) { return couch.wraps ? std::optional(at) : std::nullopt; };
  if (!axis.is_shift())
    return {.factor = sign, .unit = "\u00b0", .digits = 2, .moves = moves, .period = period(360)};
  if (couch.is_in_cm)
    return {.factor = sign / 10, .unit = "cm", .digits = 2, .moves = moves, .period = period(1000)};
  return {.factor = sign, .unit = "mm", .digits = 1, .moves = moves, .period = period(10000)};
}

/// A row of a result as the couch counts it.
struct CouchRow {
  ShownRow judged;  ///< As the verdict knows it: its judgement and its direction.
  std::optional<double> value, u95;
  double tolerance = 0.0;
  CouchAxis axis = {};
  bool is_hidden = false;  ///< Not shown; never one that is not in tolerance.
  Message way = {};        ///< What to do about it.
};

[[nodiscard]] inline CouchRow OnCouch(const ShownRow& row, Verdict verdict,
                                      const CouchProfile& couch) {
  const CouchAxis axis = CouchAxisOf(couch, row.number);
  const auto counted = [&](const std::optional<double>& value, double factor) {
    return value ? std::optional(*value * factor) : std::nullopt;
  };
  const bool asks = verdict == Verdict::kMove && row.value && !IsStill(row);
  return {.judged = row,
          .value = counted(row.value, axis.factor),
          .u95 = counted(row.u95, std::abs(axis.factor)),
          .tolerance = row.tolerance * std::abs(axis.factor),
          .axis = axis,
          .is_hidden = couch.hides_rest && !axis.moves && row.judgement == NumberJudgement::kWithin,
          .way = asks && !axis.moves ? say::result::CouchCannot() : WayOf(row, verdict)};
}

/// In an unknown room the numbers run along other axes, which no profile of a couch is about.
[[nodiscard]] inline bool RunsAlongCouch(const ResultSummary& result) {
  for (std::size_t i = 0; i < result.axes.size(); ++i)
    if (!result.axes.at(i).empty() && result.axes.at(i) != AxisName(i)) return false;
  return true;
}

/// The six numbers of a result for people; none without an answer.
[[nodiscard]] inline std::vector<CouchRow> CouchRows(const ResultSummary& result,
                                                     const CouchProfile& couch) {
  std::vector<CouchRow> rows;
  const CouchProfile& counts = RunsAlongCouch(result) ? couch : CouchProfile{};
  for (const ShownRow& row : ShownRows(result))
    rows.push_back(OnCouch(row, result.verdict, counts));
  return rows;
}

/// What is to be known beside the numbers; nothing where no profile was signed.
[[nodiscard]] inline std::vector<Message> CouchNotes(const CouchProfile& couch) {
  std::vector<Message> notes;
  if (couch.version == 0) return notes;
  std::vector<Message> reversed, unmoved;
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
    if (couch.reverses.at(i)) reversed.push_back(AxisName(i));
    if (!CouchAxisOf(couch, i).moves) unmoved.push_back(AxisName(i));
  }
  notes.push_back(say::result::CouchCounts(couch.name));
  if (!reversed.empty()) notes.push_back(say::result::CouchReverses(std::move(reversed)));
  if (!unmoved.empty()) notes.push_back(say::result::CouchLeaves(std::move(unmoved)));
  if (couch.wraps) notes.push_back(say::result::CouchWraps());
  if (couch.hides_rest && couch.num_axes < 6) notes.push_back(say::result::CouchHides());
  return notes;
}

/// What a verdict of MOVE asks for.
[[nodiscard]] inline Message CouchApply(const CouchProfile& couch) {
  return couch.num_axes == 6 ? say::result::CouchApplyAll()
                             : say::result::CouchApplySome(couch.num_axes);
}

}  // namespace plumb
