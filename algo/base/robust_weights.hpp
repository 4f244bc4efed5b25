// SPDX-License-Identifier: Apache-2.0
// Robust losses and their weights, defined once for all least-squares fits.
#pragma once

#include <cmath>

namespace plumb {

/// Tukey's cut-off in standard deviations with 95 % efficiency for normally distributed residuals.
inline constexpr double kTukeyCut = 4.685;

/// Cauchy loss of a squared residual, in units of the square: close to the square itself far below
/// `scale`, logarithmic far above.
/// @param scale  In the residual's unit, positive: where the loss changes from one to the other.
[[nodiscard]] inline double CauchyLoss(double squared, double scale) {
  return scale * scale * std::log1p(squared / (scale * scale));
}

/// Weight of a squared residual in least squares that minimise the Cauchy loss: the derivative of
/// CauchyLoss() with respect to the square. 1 at 0, one half at `scale`, always positive.
[[nodiscard]] inline double CauchyWeight(double squared, double scale) {
  return 1.0 / (1.0 + squared / (scale * scale));
}

/// Tukey weight of a residual divided by the cut-off: 1 at 0, falling smoothly to 0 at the cut-off,
/// and 0 beyond it.
[[nodiscard]] inline double TukeyWeight(double ratio_to_cut) {
  const double inside = 1.0 - ratio_to_cut * ratio_to_cut;
  return inside > 0.0 ? inside * inside : 0.0;
}

}  // namespace plumb
