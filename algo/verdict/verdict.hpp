// SPDX-License-Identifier: Apache-2.0
// Verdicts in one word.
#pragma once

#include <cstdint>

#include "algo/base/names.hpp"

namespace plumb {

/// On a comparison.
enum class Verdict : std::uint8_t {
  kInTolerance,  ///< Every value plus its uncertainty lies within its tolerance.
  kUnsure,    ///< Every value lies within its tolerance, but not every value plus its uncertainty.
  kMove,      ///< A value lies outside its tolerance.
  kNoAnswer,  ///< A gate refused: the numbers, if any, must not be acted on.
};
template <>
inline constexpr auto kNamesOf<Verdict> = NamesUpTo<Verdict::kNoAnswer>({"in_tolerance", "unsure",
                                                                         "move", "no_answer"});

/// On a check of the room's markers.
enum class MarkerCheckStatus : std::uint8_t {
  kPassed,
  kFailed,
  kNoBaseline,  ///< Everything else passed, but there is no baseline to compare with.
};
template <>
inline constexpr auto kNamesOf<MarkerCheckStatus> =
    NamesUpTo<MarkerCheckStatus::kNoBaseline>({"passed", "failed", "no_baseline"});

}  // namespace plumb
