// SPDX-License-Identifier: Apache-2.0
// One of the six numbers as every presentation of a result shows it.
#pragma once

#include <optional>

#include "algo/verdict/gates.hpp"

namespace plumb {

struct ShownRow {
  Message name;
  std::size_t number = 0;            ///< Index in kNumberNames, which has its unit.
  std::optional<double> value, u95;  ///< In its unit; not set where not known.
  double tolerance = 0.0;            ///< By which it was judged.
  NumberJudgement judgement = NumberJudgement::kUnjudged;
  Message words;  ///< Its direction, such as "up"; empty where not reported.
};

/// Its name along an axis of the couch.
[[nodiscard]] Message AxisName(std::size_t number);
/// Not distinguishable from zero: it has no direction, and asks for no move.
[[nodiscard]] bool IsStill(const ShownRow& row);
/// "in tolerance".
[[nodiscard]] Message JudgementWord(NumberJudgement judgement);
/// What to do about it. Only the verdict MOVE asks for moves.
[[nodiscard]] Message WayOf(const ShownRow& row, Verdict verdict);

}  // namespace plumb
