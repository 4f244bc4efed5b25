// SPDX-License-Identifier: Apache-2.0
// One clock for the stamps of several sensors, each of which has its own.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

namespace plumb {

/// Converts the stamps of one sensor to steady time. An image never arrives before it was taken, so
/// the shortest delay seen gives the difference of the clocks; the constant delay that remains in
/// it is the same for all sensors of a kind. Not thread-safe.
class CommonClock {
 public:
  /// @param arrived_s  Steady time. @return The stamp in steady time; it never goes back.
  double SteadyStamp(double stamp_s, double arrived_s) {
    const double offset_s = arrived_s - stamp_s;
    // The sensor was restarted, so its clock has a new origin.
    const bool is_new = !offset_s_ || std::abs(offset_s - *offset_s_) > kOtherClock_s;
    // Clocks drift, so the shortest delay seen so far must not hold for ever.
    offset_s_ =
        is_new ? offset_s : std::min(offset_s, *offset_s_ + kDrift * (arrived_s - arrived_s_));
    arrived_s_ = arrived_s;
    last_s_ = std::max(last_s_.value_or(stamp_s + *offset_s_), stamp_s + *offset_s_);
    return *last_s_;
  }

 private:
  static constexpr double kOtherClock_s = 1.0;
  static constexpr double kDrift = 1e-4;
  std::optional<double> offset_s_, last_s_;
  double arrived_s_ = 0.0;
};

}  // namespace plumb
