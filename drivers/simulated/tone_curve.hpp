// How a colour camera turns light into the numbers of its image.
#pragma once

#include <cstdint>
#include <string_view>

namespace plumb::simulated {

/// Both 0 to 1, rising. Linear light in, share of the largest code out.
struct ToneCurve {
  enum class Kind : std::uint8_t { kLinear, kPower, kSrgb, kSShaped };
  Kind kind = Kind::kSrgb;
  double gamma = 2.2;   ///< kPower and kSShaped: light^(1/gamma).
  double contrast = 0;  ///< kSShaped: share of a smooth step mixed in, below 1.

  [[nodiscard]] double Encode(double light) const;
};

[[nodiscard]] std::string_view ToString(ToneCurve::Kind kind);

/// A unit's own curve: linear, a power of 1.6 to 2.8, sRGB or S-shaped, a quarter of the units
/// each.
[[nodiscard]] ToneCurve DrawToneCurve(std::uint64_t seed);

}  // namespace plumb::simulated
