// SPDX-License-Identifier: Apache-2.0
// Whether the wall clock can be trusted for actions by date: boards without a battery start in the
// past until a time server corrects them.
#pragma once

#include <chrono>

namespace plumb {

/// Compares the wall clock with the monotonic one. Not thread-safe.
class ClockWatch {
 public:
  using Wall = std::chrono::system_clock::time_point;
  using Steady = std::chrono::steady_clock::time_point;

  ClockWatch(Wall wall, Steady steady) : wall_(wall), steady_(steady) {}

  /// If the clock has stepped since the last call, held() counts from now on. @returns the step,
  /// positive towards the future; 0 if there was none
  std::chrono::milliseconds Look(Wall wall, Steady steady) {
    const auto gone =
        std::chrono::duration_cast<std::chrono::milliseconds>((wall - wall_) - (steady - steady_));
    const bool is_step = std::chrono::abs(gone) > kStep;
    if (is_step) *this = ClockWatch(wall, steady);
    last_ = steady;
    return is_step ? gone : std::chrono::milliseconds(0);
  }

  /// Time since the last step, as of the last call.
  [[nodiscard]] std::chrono::steady_clock::duration held() const { return last_ - steady_; }

 private:
  static constexpr std::chrono::minutes kStep{
      1};  // a clock that only drifts takes months for it, and is then trusted a little later

  Wall wall_;
  Steady steady_;
  Steady last_ = steady_;
};

}  // namespace plumb
