// SPDX-License-Identifier: Apache-2.0
// Converts the level of a bouncing contact into button presses.
#pragma once

#include <chrono>
#include <optional>

#include "drivers/button.hpp"

namespace plumb {

/// A level counts once it has been stable for the debounce time. A short press is reported when it
/// ends, a long one while it is held. Pure: the caller passes the time, which must not decrease but
/// may be late, because edges are judged by their own times.
class ButtonDebouncer {
 public:
  using Clock = Button::Clock;
  struct Options {
    std::chrono::milliseconds debounce{30};
    std::chrono::milliseconds long_press{1500};  ///< Measured from the first contact.
  };

  /// @param pressed  The level at the start. A button that is held then is ignored until it is
  ///         released.
  ButtonDebouncer(const Options& options, bool pressed, Clock::time_point now);

  /// Reports that the level changed, or may have changed, at that time; the time before is
  /// evaluated first.
  [[nodiscard]] std::optional<ButtonPress> OnEdge(bool pressed, Clock::time_point then);
  /// Reports the present level after all known edges. If they imply another level, some were lost
  /// and the time of the change is unknown: the last edge then counts for the debounce time only,
  /// not for a long press.
  [[nodiscard]] std::optional<ButtonPress> OnLevel(bool pressed, Clock::time_point now);
  /// Advances the time. Must be called at deadline() and may be called at any time.
  [[nodiscard]] std::optional<ButtonPress> OnTime(Clock::time_point now);
  [[nodiscard]] std::optional<Clock::time_point> deadline() const;

 private:
  void Set(bool pressed, Clock::time_point then);

  Options options_;
  bool level_;                 ///< Latest level.
  bool stable_;                ///< Debounced level.
  bool ignored_;               ///< The current press was reported, or began before the start.
  Clock::time_point changed_;  ///< Last change of the level.
  Clock::time_point begin_;    ///< First contact of a press.
};

}  // namespace plumb
