// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/bus.hpp"

#include <poll.h>
#include <sys/epoll.h>

#include <cstdint>
#include <utility>

namespace plumb {

Bus::Bus(EventLoop& loop, const char* name, std::function<void()> broken)
    : loop_(loop), name_(name), broken_(std::move(broken)) {
  timer_ = loop_.MakeTimer(name_, [this] { Process(); });
}

Bus::~Bus() { Close(); }

void Bus::Close() {
  source_ = {};
  timer_.Disarm();
  if (bus_ != nullptr) sd_bus_close_unref(std::exchange(bus_, nullptr));
}

bool Bus::Open(const std::string& address, std::chrono::microseconds call_timeout) {
  Close();
  int result = 0;
  if (address.empty()) {
    result = sd_bus_open_system(&bus_);
  } else {
    result = sd_bus_new(&bus_);
    if (result >= 0) result = sd_bus_set_address(bus_, address.c_str());
    if (result >= 0) result = sd_bus_set_bus_client(bus_, 1);
    if (result >= 0) result = sd_bus_start(bus_);
  }
  if (result < 0) {
    Close();
    return false;
  }
  sd_bus_set_method_call_timeout(bus_, static_cast<std::uint64_t>(call_timeout.count()));
  source_ = loop_.WatchDescriptor(name_, sd_bus_get_fd(bus_), EPOLLIN,
                                  [this](std::uint32_t) { Process(); });
  return true;
}

void Bus::Process() {
  while (bus_ != nullptr) {
    const int result = sd_bus_process(bus_, nullptr);
    if (result == 0) break;
    if (result < 0) {
      Close();
      return broken_();
    }
  }
  if (bus_ == nullptr) return;
  const int events = sd_bus_get_events(bus_);
  if (events >= 0)
    source_.SetEvents(((events & POLLIN) != 0 ? EPOLLIN : 0U) |
                      ((events & POLLOUT) != 0 ? EPOLLOUT : 0U));
  std::uint64_t until_us = UINT64_MAX;
  if (sd_bus_get_timeout(bus_, &until_us) >= 0 && until_us != UINT64_MAX) {
    timer_.ArmAt(EventLoop::Clock::time_point(
        std::chrono::microseconds(until_us)));  // both use the monotonic clock
  } else {
    timer_.Disarm();
  }
}

}  // namespace plumb
