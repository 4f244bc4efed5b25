// SPDX-License-Identifier: Apache-2.0
// The six numbers of a correction as they are stored, shown and exported.
#pragma once

#include <array>
#include <optional>
#include <string_view>

namespace plumb {

/// Read back from a result; the method's own are CouchNumbers.
struct ReportedNumbers {
  /// Not set where not known, as shifts with couch-fixed markers.
  std::optional<double> vertical_mm, longitudinal_mm, lateral_mm;
  std::optional<double> pitch_deg, roll_deg, yaw_deg;
};

/// The names of one of the six numbers, and where it is found.
struct NumberAxis {
  const char* name;  ///< In result.json and in the log.
  const char* key;   ///< In JSON and CSV.
  const char* unit;
  std::optional<double> ReportedNumbers::*member;

  [[nodiscard]] constexpr bool is_shift() const { return std::string_view(unit) == "mm"; }
  /// For people.
  [[nodiscard]] constexpr const char* symbol() const { return is_shift() ? "mm" : "\u00b0"; }
  [[nodiscard]] std::optional<double> In(const std::optional<ReportedNumbers>& numbers) const {
    return numbers ? (*numbers).*member : std::nullopt;
  }
};

/// In the order of every list of the six.
inline constexpr std::array<NumberAxis, 6> kNumberAxes = {{
    {"vertical", "vertical_mm", "mm", &ReportedNumbers::vertical_mm},
    {"longitudinal", "longitudinal_mm", "mm", &ReportedNumbers::longitudinal_mm},
    {"lateral", "lateral_mm", "mm", &ReportedNumbers::lateral_mm},
    {"pitch", "pitch_deg", "deg", &ReportedNumbers::pitch_deg},
    {"roll", "roll_deg", "deg", &ReportedNumbers::roll_deg},
    {"yaw", "yaw_deg", "deg", &ReportedNumbers::yaw_deg},
}};

}  // namespace plumb
