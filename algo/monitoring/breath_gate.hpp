// SPDX-License-Identifier: Apache-2.0
// Breath hold: whether the belly is within a window about a level that was taught.
#pragma once

#include <deque>
#include <optional>
#include <utility>

#include "algo/monitoring/advice.hpp"

namespace plumb {

/// Heights above the end of expiration, as MonitorLine::breathing_m.
struct BreathWindow {
  double level_m = 0.0;
  double width_m = 0.0;  ///< Of the whole window: half of it lies above the level.
};

/// `in` after half a second inside while the height hardly changes; left by the first frame
/// outside, and unknown where the height is. Without a window it is no gate.
class BreathGate {
 public:
  /// Each frame, in the order of their stamps. @param height_m  Not set: unknown.
  [[nodiscard]] LiveAdvice Next(double time_s, const std::optional<double>& height_m);
  /// The mean of the last second becomes the level.
  /// @return Nothing if the breath was not settled over it, and the window stays what it was.
  [[nodiscard]] std::optional<BreathWindow> Teach(double width_m);
  /// It is no gate any more.
  void Forget();
  [[nodiscard]] const std::optional<BreathWindow>& window() const { return window_; }

 private:
  /// Change over the last frames since then, by a straight line. Nothing without enough of them.
  [[nodiscard]] std::optional<double> Slope_m_s(double since_s) const;

  std::deque<std::pair<double, double>> recent_;  ///< Times and heights without a gap.
  std::optional<BreathWindow> window_;
  std::optional<double> inside_since_s_;
  bool is_in_ = false;
};

/// Both gates hold; unknown counts more than out. @param breath  Not set: there is no window.
[[nodiscard]] LiveAdvice WithBreath(LiveAdvice motion, const std::optional<LiveAdvice>& breath);

}  // namespace plumb
