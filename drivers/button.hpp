// SPDX-License-Identifier: Apache-2.0
// The start button as an event source of the loop.
#pragma once

#include <chrono>
#include <functional>
#include <optional>

namespace plumb {

enum class ButtonPress { kShort, kLong };

/// A button. All calls, in both directions, are on the event loop's thread.
class Button {
 public:
  using Clock = std::chrono::steady_clock;
  virtual ~Button() = default;

  /// Readable after an event; the loop then calls Dispatch().
  [[nodiscard]] virtual int fd() const = 0;
  /// Time at which Dispatch() must be called even if nothing was readable: the end of a debounce,
  /// or the moment at which a press becomes long.
  [[nodiscard]] virtual std::optional<Clock::time_point> deadline() const = 0;
  /// Never blocks. @throws DeviceError if the line is gone.
  virtual void Dispatch(Clock::time_point now) = 0;
  /// A short press is reported on release, a long one as soon as it is long enough. A button held
  /// at the start is ignored until it is released.
  virtual void SetListener(std::function<void(ButtonPress)> pressed) = 0;
};

}  // namespace plumb
