// SPDX-License-Identifier: Apache-2.0
// The known name that a misspelt one was meant to be.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace plumb {

/// Number of letters to insert, remove or exchange to make one of the other (Levenshtein 1966).
[[nodiscard]] inline std::size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> above(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) above[j] = j;
  for (std::size_t i = 0; i < a.size(); ++i) {
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j)
      row[j + 1] = std::min({above[j + 1] + 1, row[j] + 1, above[j] + (a[i] == b[j] ? 0U : 1U)});
    std::swap(above, row);
  }
  return above[b.size()];
}

/// The known name with the smallest edit distance, the first of several; empty without names.
/// @param names  A range of texts.
template <typename Names>
[[nodiscard]] std::string NearestName(std::string_view name, const Names& names) {
  std::string nearest;
  std::size_t least = std::string_view::npos;
  for (const std::string_view known : names) {
    const std::size_t distance = EditDistance(name.substr(0, 64), known);
    if (distance >= least) continue;
    least = distance;
    nearest = known;
  }
  return nearest;
}

}  // namespace plumb
