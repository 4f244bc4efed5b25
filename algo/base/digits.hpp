// SPDX-License-Identifier: Apache-2.0
// How numbers and their uncertainties are written, in reports and on the page without scripts.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>

namespace plumb {

/// Decimals of a value that its uncertainty justifies: none below the first digit of `u95`, and at
/// most `most`, which is also the answer for an unknown uncertainty (0 or NaN).
[[nodiscard]] inline int DecimalsFor(double u95, int most) {
  if (!(u95 > 0)) return most;
  return std::clamp(static_cast<int>(-std::floor(std::log10(u95) + 1e-9)), 0, most);
}

/// A value and its uncertainty as shown: "\u22123" and "1.1".
struct ShownNumber {
  std::string value, u95;
  bool is_zero = false;  ///< The shown value is zero: it has neither sign nor direction.
};

/// The value has the decimals that its uncertainty justifies, a true minus sign, and no sign if it
/// is zero. The uncertainty has one more decimal if its first digit is 1 (JCGM 100, 7.2.6), and is
/// empty if it is unknown.
/// @param most     Largest number of decimals of either.
/// @param decimal  Decimal sign of the language.
[[nodiscard]] ShownNumber Shown(double value, double u95, int most, char decimal);

/// Both in one: "\u22123 \u00b11.1".
[[nodiscard]] std::string ValueWithUncertainty(double value, double u95, int most, char decimal);

/// Without trailing zeros: "2.5", "3".
[[nodiscard]] std::string PlainNumber(double value, char decimal);

}  // namespace plumb
