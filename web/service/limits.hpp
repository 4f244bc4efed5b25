// Limits of settings and plans, used by requests, the appliance and the store.
#pragma once

#include <algorithm>
#include <array>
#include <string_view>

namespace plumb::web {

struct Range {
  double least = 0.0, most = 0.0;

  /// Also false for a value that is not a number.
  [[nodiscard]] constexpr bool Holds(double value) const { return value >= least && value <= most; }
};

inline constexpr Range kShiftTolerance_mm{0.1, 50}, kRotationTolerance_deg{0.1, 20};
inline constexpr Range kAutoStop_s{1, 120}, kScanLimit_s{5, 600};
inline constexpr Range kRetention_days{0, 36500}, kIdleLogout_min{1, 240};

/// Head or feet first, supine or prone.
inline constexpr std::array<std::string_view, 4> kPostures = {"HFS", "HFP", "FFS", "FFP"};

[[nodiscard]] constexpr bool IsPosture(std::string_view text) {
  return std::find(kPostures.begin(), kPostures.end(), text) != kPostures.end();
}

}  // namespace plumb::web
