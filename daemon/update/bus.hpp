// SPDX-License-Identifier: Apache-2.0
// A connection to a message bus that the event loop serves.
#pragma once

#include <chrono>
#include <functional>
#include <string>

#include <systemd/sd-bus.h>

#include "daemon/loop/event_loop.hpp"

namespace plumb {

/// Used on the loop's thread, where its calls are answered.
class Bus {
 public:
  /// @param name    Name for the loop's meter.
  /// @param broken  Called when an open connection has broken; it is closed by then.
  Bus(EventLoop& loop, const char* name, std::function<void()> broken);
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  /// @param address  Empty: the system bus. @return False if there is none.
  bool Open(const std::string& address, std::chrono::microseconds call_timeout);
  void Close();
  /// Sends and receives as much as possible without waiting. Call it after calls from outside the
  /// loop's callbacks.
  void Process();
  [[nodiscard]] sd_bus* get() const { return bus_; }

 private:
  EventLoop& loop_;
  const char* name_;
  std::function<void()> broken_;
  sd_bus* bus_ = nullptr;
  EventLoop::Source source_, timer_;
};

}  // namespace plumb
