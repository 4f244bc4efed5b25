// SPDX-License-Identifier: Apache-2.0
// What a course and a group of courses say about set-up: mean and standard deviation of the six
// numbers over the fractions, and from them the systematic and the random error of the group (M.
// van Herk, Semin. Radiat. Oncol. 14, 2004).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "web/model/numbers.hpp"
#include "web/model/scan.hpp"

namespace plumb {

/// Of one number over the fractions in which it is known.
struct NumberSpread {
  int count = 0;
  double mean = 0.0;
  std::optional<double> deviation;  ///< With count - 1; not set for a single value.
};
using NumberSpreads = std::array<NumberSpread, kNumberAxes.size()>;

[[nodiscard]] inline NumberSpread SpreadOf(const std::vector<double>& values) {
  NumberSpread spread{.count = static_cast<int>(values.size()), .mean = 0, .deviation = {}};
  if (values.empty()) return spread;
  const double count = static_cast<double>(values.size());
  for (const double value : values) spread.mean += value / count;
  if (values.size() == 1) return spread;
  double squares = 0;
  for (const double value : values) squares += (value - spread.mean) * (value - spread.mean);
  spread.deviation = std::sqrt(squares / (count - 1));
  return spread;
}

/// The first and the last answer of a fraction: how the patient was found, and how left.
struct CourseStatistics {
  int fractions = 0;                ///< With an answer.
  int scans = 0;                    ///< With an answer.
  int accepted = 0, overrides = 0;  ///< Fractions; overrides: with a reason, outside tolerance.
  NumberSpreads first = {}, last = {};
  /// Median time from the beginning of the first scan of a fraction to its acceptance.
  std::optional<double> minutes = {};
};

[[nodiscard]] inline std::optional<double> MedianOf(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  std::ranges::sort(values);
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

/// @param scans  Of one patient, in any order; those without an answer do not count.
[[nodiscard]] inline CourseStatistics StatisticsOf(const std::vector<Scan>& scans) {
  std::map<std::string, std::vector<const Scan*>> fractions;
  CourseStatistics course;
  for (const Scan& scan : scans) {
    const bool counts = scan.outcome == ScanOutcome::kDone &&
                        scan.purpose == ScanPurpose::kFraction && scan.result &&
                        !ShownRows(*scan.result).empty();
    if (!counts) continue;
    fractions[scan.session_id.empty() ? "scan " + scan.id : scan.session_id].push_back(&scan);
    ++course.scans;
  }
  course.fractions = static_cast<int>(fractions.size());
  std::array<std::vector<double>, kNumberAxes.size()> first, last;
  std::vector<double> minutes;
  for (auto& [session, of_session] : fractions) {
    std::ranges::sort(of_session, {}, &Scan::id);  // numbers of one length, as they were given
    for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
      if (const auto value = kNumberAxes[i].In(of_session.front()->result->correction))
        first[i].push_back(*value);
      if (const auto value = kNumberAxes[i].In(of_session.back()->result->correction))
        last[i].push_back(*value);
    }
    const auto accepted = std::ranges::find_if(
        of_session, [](const Scan* scan) { return !scan->accepted_by.empty(); });
    if (accepted == of_session.end()) continue;
    ++course.accepted;
    if (!(*accepted)->accepted_reason.empty()) ++course.overrides;
    if (!(*accepted)->accepted_at) continue;
    const std::chrono::duration<double, std::ratio<60>> taken =
        *(*accepted)->accepted_at - of_session.front()->started_at;
    if (taken.count() >= 0) minutes.push_back(taken.count());  // else the clock was set
  }
  std::ranges::transform(first, course.first.begin(), SpreadOf);
  std::ranges::transform(last, course.last.begin(), SpreadOf);
  course.minutes = MedianOf(std::move(minutes));
  return course;
}

/// What is compared with another reference is another course.
struct CoursePart {
  std::string reference_id;  ///< Empty: of scans from before references were kept.
  CourseStatistics statistics;
};

/// Those with an answer, the one with the newest scan first.
[[nodiscard]] inline std::vector<CoursePart> PartsOf(const std::vector<Scan>& scans) {
  std::map<std::string, std::vector<Scan>> of_reference;
  for (const Scan& scan : scans) of_reference[scan.reference_id].push_back(scan);
  std::vector<std::pair<std::string, CoursePart>> found;  // with the newest scan
  for (const auto& [reference, compared] : of_reference) {
    CoursePart part{.reference_id = reference, .statistics = StatisticsOf(compared)};
    if (part.statistics.fractions > 0)
      found.emplace_back(std::ranges::max(compared, {}, &Scan::id).id, std::move(part));
  }
  std::ranges::sort(found, std::ranges::greater(), [](const auto& one) { return one.first; });
  std::vector<CoursePart> parts;
  for (auto& [newest, part] : found) parts.push_back(std::move(part));
  return parts;
}

/// Of one number over the courses of a group.
struct GroupSpread {
  int courses = 0;                   ///< In which it is known.
  double mean = 0.0;                 ///< Of the courses' means: what the whole group has.
  std::optional<double> systematic;  ///< Standard deviation of the courses' means.
  std::optional<double> random;      ///< Root mean square of the courses' deviations.
};

/// @param which  &CourseStatistics::first or last.
[[nodiscard]] inline GroupSpread GroupSpreadOf(const std::vector<CourseStatistics>& courses,
                                               NumberSpreads CourseStatistics::*which,
                                               std::size_t number) {
  std::vector<double> means, squares;
  for (const CourseStatistics& course : courses) {
    const NumberSpread& spread = (course.*which).at(number);
    if (spread.count > 0) means.push_back(spread.mean);
    if (spread.deviation) squares.push_back(*spread.deviation * *spread.deviation);
  }
  const NumberSpread spread = SpreadOf(means);
  GroupSpread group{
      .courses = spread.count, .mean = spread.mean, .systematic = spread.deviation, .random = {}};
  if (!squares.empty()) group.random = std::sqrt(SpreadOf(squares).mean);
  return group;
}

}  // namespace plumb
