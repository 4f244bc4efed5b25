// Conversion of light to image values by a colour camera.
#pragma once

#include <cstdint>
#include <string_view>

namespace plumb::simulated {

/// From linear light to a fraction of the largest code, both 0 to 1, increasing.
struct ToneCurve {
  enum class Kind : std::uint8_t { kLinear, kPower, kSrgb, kSShaped };
  Kind kind = Kind::kSrgb;
  double gamma = 2.2;   ///< kPower and kSShaped: light^(1/gamma).
  double contrast = 0;  ///< kSShaped: fraction of a smooth step that is mixed in, below 1.

  [[nodiscard]] double Encode(double light) const;
};

[[nodiscard]] std::string_view ToString(ToneCurve::Kind kind);

/// A unit's own curve: linear, a power of 1.6 to 2.8, sRGB or S-shaped, each for a quarter of the
/// units.
[[nodiscard]] ToneCurve DrawToneCurve(std::uint64_t seed);

}  // namespace plumb::simulated
