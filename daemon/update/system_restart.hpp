// SPDX-License-Identifier: Apache-2.0
// Restarting the machine.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "algo/base/message.hpp"
#include "daemon/loop/event_loop.hpp"

namespace plumb {

/// Used on the loop's thread.
class SystemRestart {
 public:
  virtual ~SystemRestart() = default;
  /// Calls `done` once, on the loop: with nothing once the machine goes down, otherwise with why
  /// it does not.
  virtual void Restart(std::function<void(const Message& failure)> done) = 0;
  /// After this time, a machine that still runs is not going down any more.
  [[nodiscard]] virtual std::chrono::milliseconds limit() const { return std::chrono::minutes(5); }
};

/// Uses systemd's logind (org.freedesktop.login1.Manager.Reboot), if its policy permits this
/// account.
/// @param bus_address  Empty: the system bus.
[[nodiscard]] std::unique_ptr<SystemRestart> MakeLogindRestart(EventLoop& loop,
                                                               const std::string& bus_address);

}  // namespace plumb
