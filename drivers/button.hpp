// The start button, as the event loop sees it.
#pragma once

#include <chrono>
#include <functional>
#include <optional>

namespace plumb {

enum class ButtonPress { kShort, kLong };

/// A button. One thread (the event loop's) calls everything and is called.
class Button {
 public:
  using Clock = std::chrono::steady_clock;
  virtual ~Button() = default;

  /// Readable when something happened; the loop then calls Dispatch().
  [[nodiscard]] virtual int fd() const = 0;
  /// When Dispatch() wants to be called even if nothing was readable: the end of a debounce, the
  /// moment a press becomes long.
  [[nodiscard]] virtual std::optional<Clock::time_point> deadline() const = 0;
  /// Never blocks. @throws DeviceError if the line is gone.
  virtual void Dispatch(Clock::time_point now) = 0;
  /// A short press is reported on release, a long one as soon as it is long. A button held at start
  /// is no press until released.
  virtual void SetListener(std::function<void(ButtonPress)> pressed) = 0;
};

}  // namespace plumb
