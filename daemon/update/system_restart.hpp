// Restarting the machine.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "daemon/loop/event_loop.hpp"

namespace plumb {

/// Belongs to the loop's thread.
class SystemRestart {
 public:
  virtual ~SystemRestart() = default;
  /// Calls `done` once, on the loop: with nothing once the machine goes down, else with a sentence
  /// that says why it does not.
  virtual void Restart(std::function<void(const std::string& failure)> done) = 0;
};

/// systemd's logind does it (org.freedesktop.login1.Manager.Reboot), where its policy lets this
/// account. @param bus_address  Empty: the system bus.
[[nodiscard]] std::unique_ptr<SystemRestart> MakeLogindRestart(EventLoop& loop,
                                                               const std::string& bus_address);

}  // namespace plumb
