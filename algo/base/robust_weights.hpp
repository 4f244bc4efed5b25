// Robust losses and their weights: one definition of each for every least-squares fit.
#pragma once

#include <cmath>

namespace plumb {

/// Tukey's cut in standard deviations that keeps 95 % efficiency on normally distributed residuals.
inline constexpr double kTukeyCut = 4.685;

/// Cauchy's loss of a squared residual, in the unit of the square. Nearly the square itself far
/// below `scale`, and grows only with the logarithm far above.
/// @param scale  In the residual's unit, above 0: where the loss turns from one to the other.
[[nodiscard]] inline double CauchyLoss(double squared, double scale) {
  return scale * scale * std::log1p(squared / (scale * scale));
}

/// Weight by which a squared residual counts in least squares that descend on Cauchy's loss: the
/// derivative of CauchyLoss() by the square. 1 at 0, a half at `scale`, never quite 0.
[[nodiscard]] inline double CauchyWeight(double squared, double scale) {
  return 1.0 / (1.0 + squared / (scale * scale));
}

/// Tukey's weight of a residual divided by the cut: 1 at 0, falling smoothly to 0 at the cut, and 0
/// beyond it.
[[nodiscard]] inline double TukeyWeight(double ratio_to_cut) {
  const double inside = 1.0 - ratio_to_cut * ratio_to_cut;
  return inside > 0.0 ? inside * inside : 0.0;
}

}  // namespace plumb
