// The six numbers of a correction as they are stored, shown and exported.
#pragma once

#include <array>
#include <optional>
#include <string_view>

namespace plumb {

/// Read back from a result; the method's own are CouchNumbers.
struct ReportedNumbers {
  std::optional<double> vertical_mm;  ///< Shifts are not set with couch-fixed markers.
  std::optional<double> longitudinal_mm;
  std::optional<double> lateral_mm;
  /// Rotations are always set; optional only so that kNumberAxes has one type of member.
  std::optional<double> pitch_deg = 0.0;
  std::optional<double> roll_deg = 0.0;
  std::optional<double> yaw_deg = 0.0;
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
