// SPDX-License-Identifier: Apache-2.0
// Whether one number of a correction is in tolerance. Decided once, with the verdict, and stored
// beside the number; everything else reads what was stored.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

#include "algo/base/names.hpp"

namespace plumb {

enum class NumberJudgement : std::uint8_t {
  kUnjudged,  ///< The value, or the uncertainty that decides, is not known.
  kWithin,    ///< In tolerance with its whole uncertainty.
  kUnsure,    ///< In tolerance, but not with its uncertainty.
  kOutside,
};
template <>
inline constexpr auto kNamesOf<NumberJudgement> =
    NamesUpTo<NumberJudgement::kOutside>({"not_judged", "in_tolerance", "unsure", "outside"});

/// All in one unit; a limit itself is within it. What is not finite is not known. A value outside
/// tolerance is so whatever its uncertainty. No measurement is exact: an uncertainty of 0
/// counts as not stated.
/// @param u95  Half width of the interval of 95 %.
[[nodiscard]] inline NumberJudgement JudgeNumber(std::optional<double> value,
                                                 std::optional<double> u95, double tolerance) {
  if (!value || !std::isfinite(*value) || !std::isfinite(tolerance))
    return NumberJudgement::kUnjudged;
  if (std::abs(*value) > tolerance) return NumberJudgement::kOutside;
  if (!u95 || !std::isfinite(*u95) || !(*u95 > 0)) return NumberJudgement::kUnjudged;
  return std::abs(*value) + *u95 <= tolerance ? NumberJudgement::kWithin : NumberJudgement::kUnsure;
}

}  // namespace plumb
