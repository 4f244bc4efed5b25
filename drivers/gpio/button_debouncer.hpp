// Turns the level of a bouncing contact into presses of a button.
#pragma once

#include <chrono>
#include <optional>

#include "drivers/button.hpp"

namespace plumb {

/// A level counts once it has been stable for the debounce time. A short press is reported when it
/// ends, a long one while it is held. Pure: the caller passes the time, which must not go back, but
/// may be late: edges are judged by when they happened.
class ButtonDebouncer {
 public:
  using Clock = Button::Clock;
  struct Options {
    std::chrono::milliseconds debounce{30};
    std::chrono::milliseconds long_press{1500};  ///< From the first contact on.
  };

  /// @param pressed  The level at the start; a button that is held then is ignored until it is
  /// released.
  ButtonDebouncer(const Options& options, bool pressed, Clock::time_point now);

  /// The level changed at that time, or may have; the time until then is evaluated first.
  [[nodiscard]] std::optional<ButtonPress> OnEdge(bool pressed, Clock::time_point then);
  /// The level as it is now, after all known edges. Where they imply another one, some were lost
  /// and the time of the change is unknown: the last edge then counts for the debounce time only,
  /// not for a long press.
  [[nodiscard]] std::optional<ButtonPress> OnLevel(bool pressed, Clock::time_point now);
  /// Advances the time; to be called at deadline(), and may be called at any
  /// time.
  [[nodiscard]] std::optional<ButtonPress> OnTime(Clock::time_point now);
  [[nodiscard]] std::optional<Clock::time_point> deadline() const;

 private:
  void Set(bool pressed, Clock::time_point then);

  Options options_;
  bool level_;                 ///< The latest level.
  bool stable_;                ///< The debounced level.
  bool ignored_;               ///< The current press was reported, or began before the start.
  Clock::time_point changed_;  ///< The last change of level.
  Clock::time_point begin_;    ///< The first contact of a press.
};

}  // namespace plumb
