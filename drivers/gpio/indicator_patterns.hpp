// SPDX-License-Identifier: Apache-2.0
// The patterns of light and beeper for each state, and their player.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>

#include "drivers/indicator.hpp"

namespace plumb {

/// Outputs as bits. A device with fewer lights shows every colour with those that it has.
enum IndicatorOutput : std::uint8_t { kRed = 1, kGreen = 2, kBlue = 4, kBeeper = 8 };

struct IndicatorStep {
  std::uint8_t outputs = 0;             ///< Bits of IndicatorOutput.
  std::chrono::milliseconds length{0};  ///< 0: without end.
};

/// Steps are played in order; those from `repeat_from` on are repeated.
struct IndicatorProgram {
  static constexpr std::size_t kMaxSteps = 5;

  IndicatorPattern pattern;
  std::array<IndicatorStep, kMaxSteps> steps{};
  std::size_t num_steps;
  std::size_t repeat_from;

  consteval IndicatorProgram(IndicatorPattern shown, std::initializer_list<IndicatorStep> played,
                             std::size_t first_repeated = 0)
      : pattern(shown), num_steps(played.size()), repeat_from(first_repeated) {
    std::copy(played.begin(), played.end(), steps.begin());
  }
};

/// Patterns also differ in rhythm, so that a lamp of one colour can show them all.
[[nodiscard]] const IndicatorProgram& ProgramOf(IndicatorPattern pattern);

/// Plays the steps of one pattern. Pure: the caller passes the time.
class IndicatorPlayer {
 public:
  using Clock = std::chrono::steady_clock;
  /// Starts a pattern; if it is the current one, it continues undisturbed.
  void Show(IndicatorPattern pattern, Clock::time_point now);
  /// Advances to `now`.
  void OnTime(Clock::time_point now);
  [[nodiscard]] std::uint8_t outputs() const { return program_->steps[step_].outputs; }
  [[nodiscard]] std::optional<Clock::time_point> deadline() const;

 private:
  const IndicatorProgram* program_ = &ProgramOf(IndicatorPattern::kOff);
  std::size_t step_ = 0;
  Clock::time_point step_begin_{};
};

}  // namespace plumb
