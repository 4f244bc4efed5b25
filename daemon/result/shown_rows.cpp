// SPDX-License-Identifier: Apache-2.0
#include "daemon/result/shown_rows.hpp"

#include <array>

#include "daemon/result/axis_names.hpp"

namespace plumb {

std::vector<ShownRow> ShownRowsOf(const StoredCorrection& correction, Verdict verdict) {
  std::vector<ShownRow> rows;
  if (verdict == Verdict::kNoAnswer) return rows;
  for (std::size_t i = 0; i < kNumberNames.size(); ++i)
    rows.push_back({.name = AxisName(i),
                    .number = i,
                    .value = correction.value.at(i),
                    .u95 = correction.u95.at(i),
                    .judgement = correction.judgements.at(i),
                    .words = correction.words.at(i)});
  return rows;
}

std::vector<ShownRow> ShownRowsOf(const StoredResult& result) {
  if (!result.correction) return {};
  std::vector<ShownRow> rows = ShownRowsOf(*result.correction, result.verdict);
  const std::array<Message, 6> names = AxisNames(result.body);
  for (ShownRow& row : rows) {
    row.name = names.at(row.number);
    row.tolerance = result.limits.ToleranceOf(row.number);
  }
  return rows;
}

}  // namespace plumb
