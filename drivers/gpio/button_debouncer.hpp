// From the level of a contact that chatters to presses of a button.
#pragma once

#include <chrono>
#include <optional>

#include "drivers/button.hpp"

namespace plumb {

/// A level counts once it has stood still for the debounce time. A short press is reported when it
/// ends, a long one while it is held. Pure: the caller brings the time, which must not go back, but
/// may come late: edges are judged by when they happened.
class ButtonDebouncer {
 public:
  using Clock = Button::Clock;
  struct Options {
    std::chrono::milliseconds debounce{30};
    std::chrono::milliseconds long_press{1500};  ///< From the first contact on.
  };

  /// @param pressed  The level at the start; held then, the button does nothing until it was
  /// released.
  ButtonDebouncer(const Options& options, bool pressed, Clock::time_point now);

  /// The level changed then (or may have), and what the time until then makes of it.
  [[nodiscard]] std::optional<ButtonPress> OnEdge(bool pressed, Clock::time_point then);
  /// The level as it is now, after all edges that are known. Where they tell another, some were
  /// lost, and nobody knows when it changed: what the last one told counts for the debounce time,
  /// not for a long press.
  [[nodiscard]] std::optional<ButtonPress> OnLevel(bool pressed, Clock::time_point now);
  /// Lets time pass; to be called at deadline(), and may be called at any
  /// time.
  [[nodiscard]] std::optional<ButtonPress> OnTime(Clock::time_point now);
  [[nodiscard]] std::optional<Clock::time_point> deadline() const;

 private:
  void Set(bool pressed, Clock::time_point then);

  Options options_;
  bool level_;    ///< As it came last.
  bool stable_;   ///< As it counts.
  bool ignored_;  ///< The press that is going on was reported, or began before the start.
  Clock::time_point changed_;  ///< When the level changed last.
  Clock::time_point begin_;    ///< Of the first contact of a press.
};

}  // namespace plumb
