// SPDX-License-Identifier: Apache-2.0
#include "algo/verdict/shown_row.hpp"

#include <cmath>

#include "algo/base/digits.hpp"
#include "words/result.hpp"

namespace plumb {
namespace {

bool PrintsAsZero(const ShownRow& row) {
  return row.value &&
         Shown(*row.value, row.u95.value_or(NAN), IsShift(row.number) ? 1 : 2, '.').is_zero;
}

}  // namespace

Message AxisName(std::size_t number) {
  namespace name = say::result;
  constexpr std::array<Message (*)(), 6> kNames = {name::AxisVertical, name::AxisLongitudinal,
                                                   name::AxisLateral,  name::AxisPitch,
                                                   name::AxisRoll,     name::AxisYaw};
  return kNames.at(number)();
}

bool IsStill(const ShownRow& row) {
  return PrintsAsZero(row) || (row.value && row.u95 && std::abs(*row.value) <= *row.u95);
}

Message JudgementWord(NumberJudgement judgement) {
  switch (judgement) {
    case NumberJudgement::kWithin:
      return say::result::Within();
    case NumberJudgement::kUnsure:
      return say::result::NotSurely();
    case NumberJudgement::kOutside:
      return say::result::Outside();
    case NumberJudgement::kUnjudged:
      break;
  }
  return say::result::NotKnown();
}

Message WayOf(const ShownRow& row, Verdict verdict) {
  if (!row.value) return say::result::NotKnown();
  if (verdict != Verdict::kMove)
    return row.judgement == NumberJudgement::kWithin ? say::result::NoMove()
                                                     : say::result::ScanAgain();
  if (PrintsAsZero(row)) return say::result::PageNoChange();
  return IsStill(row) ? say::result::Insignificant() : row.words;
}

}  // namespace plumb
