// SPDX-License-Identifier: Apache-2.0
// The papers that sheets and reports are made for.
#pragma once

#include <algorithm>
#include <array>
#include <string_view>

namespace plumb {

/// Upright.
struct Paper {
  std::string_view name;
  double width_mm, height_mm;
};
// ISO 216, and ANSI/ASME Y14.1 (8.5 by 11 and 11 by 17 inches).
inline constexpr std::array<Paper, 4> kPapers = {{{"A4", 210.0, 297.0},
                                                  {"A3", 297.0, 420.0},
                                                  {"Letter", 215.9, 279.4},
                                                  {"Tabloid", 279.4, 431.8}}};
inline constexpr double kPointsPerMm = 72.0 / 25.4;

/// Null if there is none of that name.
[[nodiscard]] constexpr const Paper* FindPaper(std::string_view name) {
  const auto* const found = std::ranges::find(kPapers, name, &Paper::name);
  return found == kPapers.end() ? nullptr : found;
}

}  // namespace plumb
