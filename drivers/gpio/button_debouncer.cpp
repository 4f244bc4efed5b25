// SPDX-License-Identifier: Apache-2.0
#include "drivers/gpio/button_debouncer.hpp"

#include <algorithm>

namespace plumb {

ButtonDebouncer::ButtonDebouncer(const Options& options, bool pressed, Clock::time_point now)
    : options_(options),
      level_(pressed),
      stable_(pressed),
      ignored_(pressed),
      changed_(now),
      begin_(now) {}

std::optional<ButtonPress> ButtonDebouncer::OnEdge(bool pressed, Clock::time_point then) {
  const std::optional<ButtonPress> press = OnTime(then);
  Set(pressed, then);
  return press;
}

std::optional<ButtonPress> ButtonDebouncer::OnLevel(bool pressed, Clock::time_point now) {
  if (pressed == level_) return OnTime(now);
  const std::optional<ButtonPress> press = OnTime(std::min(now, changed_ + options_.debounce));
  Set(pressed, now);
  return press;
}

void ButtonDebouncer::Set(bool pressed, Clock::time_point then) {
  if (pressed == level_) return;
  if (pressed && !stable_ && then - changed_ >= options_.debounce)
    begin_ = then;  // the first contact after a stable level
  level_ = pressed;
  changed_ = then;
}

std::optional<ButtonPress> ButtonDebouncer::OnTime(Clock::time_point now) {
  if (level_ != stable_ && now - changed_ >= options_.debounce) {
    stable_ = level_;
    if (stable_) {
      ignored_ = false;
    } else if (!ignored_) {
      ignored_ = true;
      return ButtonPress::kShort;
    }
  }
  if (stable_ && level_ && !ignored_ && now - begin_ >= options_.long_press) {
    ignored_ = true;
    return ButtonPress::kLong;
  }
  return std::nullopt;
}

std::optional<ButtonDebouncer::Clock::time_point> ButtonDebouncer::deadline() const {
  if (level_ != stable_) return changed_ + options_.debounce;
  if (stable_ && !ignored_) return begin_ + options_.long_press;
  return std::nullopt;
}

}  // namespace plumb
