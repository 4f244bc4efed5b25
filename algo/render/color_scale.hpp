// SPDX-License-Identifier: Apache-2.0
// Colours of height differences.
#pragma once

#include <string>
#include <vector>

#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Colour of cells where nothing was measured, in every picture; no scale uses it.
inline constexpr Color kHoleColor = {150, 152, 156};
/// Not measured inside the region: every second stripe, the others are white. Told apart without
/// any colour, and as on the page (web/page/drawings/maps.js).
inline constexpr Color kRegionHoleColor = {10, 10, 12};

/// `fraction_of_b` of the way from `a` to `b`, which is from 0 to 1.
[[nodiscard]] Color Mix(const Color& a, const Color& b, double fraction_of_b);

/// Maps a difference in metres to a colour.
///
/// Signed (the default of Plumb): blue below, orange above, nearly white within the tolerance, with
/// a step at the tolerance; safe for colour-blind users (blue and orange, lightness decreases with
/// size). The axis is logarithmic in |e| / tolerance so that 1, 2, 5, 10 and 20 tolerances can be
/// distinguished. Paper: blue at 0 to red at 10 cm of |e|, linear.
class ColorScale {
 public:
  /// @throws std::invalid_argument unless tolerance_m > 0.
  [[nodiscard]] static ColorScale Signed(double tolerance_m);
  [[nodiscard]] static ColorScale Paper();

  /// Colour of a difference. Beyond the range it is the colour of the end; NaN has the colour of
  /// holes.
  [[nodiscard]] Color operator()(double difference_m) const;

  /// Position on the legend, 0 at the lower end and 1 at the upper, clamped.
  [[nodiscard]] double Position(double difference_m) const;
  /// Inverse of Position() inside the range.
  [[nodiscard]] double Difference(double position) const;

  struct Tick {
    double difference_m;
    std::string label;  ///< In millimetres or centimetres, with a sign where the scale has one.
  };
  [[nodiscard]] std::vector<Tick> Ticks() const;
  [[nodiscard]] std::string unit() const { return is_signed_ ? "mm" : "cm"; }

  [[nodiscard]] bool is_signed() const { return is_signed_; }
  [[nodiscard]] double tolerance_m() const { return tolerance_m_; }

 private:
  ColorScale(bool is_signed, double tolerance_m)
      : is_signed_(is_signed), tolerance_m_(tolerance_m) {}
  bool is_signed_;
  double tolerance_m_;  // used by the signed scale only
};

}  // namespace plumb
