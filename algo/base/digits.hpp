// How precisely a number is shown.
#pragma once

#include <algorithm>
#include <cmath>

namespace plumb {

/// Decimals of a value that its uncertainty justifies: none below the first digit of `u95`, and at
/// most `most`, which is also the answer for an unknown uncertainty (0 or NaN).
[[nodiscard]] inline int DecimalsFor(double u95, int most) {
  if (!(u95 > 0)) return most;
  return std::clamp(static_cast<int>(-std::floor(std::log10(u95) + 1e-9)), 0, most);
}

}  // namespace plumb
