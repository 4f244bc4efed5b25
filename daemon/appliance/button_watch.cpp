// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/button_watch.hpp"

#include <sys/epoll.h>

#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/loop/log.hpp"

namespace plumb {

ButtonWatch::ButtonWatch(EventLoop& loop, Button* button, std::function<void(ButtonPress)> pressed)
    : button_(button) {
  if (button_ == nullptr) return;
  button_->SetListener(std::move(pressed));
  timer_ = loop.MakeTimer("button", [this] { Dispatch(); });
  source_ =
      loop.WatchDescriptor("button", button_->fd(), EPOLLIN, [this](std::uint32_t) { Dispatch(); });
  ArmTimer();
}

void ButtonWatch::Tick() {
  if (button_ != nullptr && source_.is_armed()) ArmTimer();
}

void ButtonWatch::Dispatch() {
  try {
    button_->Dispatch(Button::Clock::now());
    ArmTimer();
  } catch (const DeviceError& error) {
    Log(LogLevel::kError, fmt::format("the button does not work any more: {}", error.what()));
    source_ = {};
  }
}

void ButtonWatch::ArmTimer() {
  if (const auto deadline = button_->deadline()) {
    timer_.ArmAt(*deadline);
  } else {
    timer_.Disarm();
  }
}

}  // namespace plumb
