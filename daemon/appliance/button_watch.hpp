// SPDX-License-Identifier: Apache-2.0
// The hardware button on the event loop.
#pragma once

#include <functional>

#include "daemon/loop/event_loop.hpp"
#include "drivers/button.hpp"

namespace plumb {

class ButtonWatch {
 public:
  /// @param button  Borrowed; null: there is none. @param pressed  Called on the loop.
  ButtonWatch(EventLoop& loop, Button* button, std::function<void(ButtonPress)> pressed);
  /// Looks for a deadline that the button has set by itself.
  void Tick();

 private:
  void Dispatch();
  void ArmTimer();

  Button* const button_;
  EventLoop::Source source_, timer_;
};

}  // namespace plumb
