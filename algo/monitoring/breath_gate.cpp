// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/breath_gate.hpp"

#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

constexpr double kSettled_s = 1.0;
constexpr double kEnterBreath_s = 0.5;
constexpr double kMostSlope_m_s = 0.002;
/// The trace's own noise is 0.2 to 0.4 mm (docs/monitoring.md): over a second a held breath lies
/// within about six times that.
constexpr double kMostRange_m = 0.002;
constexpr std::size_t kLeastHeights = 5;

}  // namespace

LiveAdvice BreathGate::Next(double time_s, const std::optional<double>& height_m) {
  const bool gap = !recent_.empty() && time_s - recent_.back().first > kLongestGap_s;
  if (gap || !height_m) {
    recent_.clear();
    inside_since_s_.reset();
    is_in_ = false;
  }
  if (!height_m) return LiveAdvice::kUnknown;
  recent_.emplace_back(time_s, *height_m);
  while (recent_.front().first < time_s - kSettled_s - 1e-9) recent_.pop_front();
  if (!window_) return LiveAdvice::kIn;
  if (!(std::abs(*height_m - window_->level_m) <= window_->width_m / 2)) {
    inside_since_s_.reset();
    is_in_ = false;
    return LiveAdvice::kOut;
  }
  if (!inside_since_s_) inside_since_s_ = time_s;
  const std::optional<double> slope = Slope_m_s(time_s - kEnterBreath_s);
  if (time_s - *inside_since_s_ >= kEnterBreath_s && slope && std::abs(*slope) < kMostSlope_m_s)
    is_in_ = true;
  return is_in_ ? LiveAdvice::kIn : LiveAdvice::kOut;
}

std::optional<BreathWindow> BreathGate::Teach(double width_m) {
  if (recent_.size() < kLeastHeights ||
      recent_.back().first - recent_.front().first < kSettled_s - kLongestGap_s)
    return std::nullopt;
  double least = recent_.front().second, most = least, sum = 0;
  for (const auto& [time_s, height_m] : recent_) {
    least = std::min(least, height_m);
    most = std::max(most, height_m);
    sum += height_m;
  }
  const std::optional<double> slope = Slope_m_s(recent_.front().first);
  if (most - least > kMostRange_m || !slope || std::abs(*slope) >= kMostSlope_m_s)
    return std::nullopt;
  window_ = {.level_m = sum / static_cast<double>(recent_.size()), .width_m = width_m};
  inside_since_s_.reset();
  is_in_ = false;
  return window_;
}

void BreathGate::Forget() {
  window_.reset();
  inside_since_s_.reset();
  is_in_ = false;
}

std::optional<double> BreathGate::Slope_m_s(double since_s) const {
  double count = 0, time = 0, height = 0, squares = 0, products = 0;
  for (const auto& [time_s, height_m] : recent_) {
    const double at = time_s - recent_.back().first;
    if (time_s < since_s - 1e-9) continue;
    count += 1;
    time += at;
    height += height_m;
    squares += at * at;
    products += at * height_m;
  }
  const double spread = squares - time * time / std::max(1.0, count);
  if (count < kLeastHeights || !(spread > 0)) return std::nullopt;
  return (products - time * height / count) / spread;
}

LiveAdvice WithBreath(LiveAdvice motion, const std::optional<LiveAdvice>& breath) {
  if (!breath || motion == LiveAdvice::kUnknown) return motion;
  if (*breath == LiveAdvice::kUnknown) return LiveAdvice::kUnknown;
  return motion == LiveAdvice::kIn ? *breath : motion;
}

}  // namespace plumb
