// SPDX-License-Identifier: Apache-2.0
// The hardware panel of the appliance: start button and light on GPIO lines, if they are configured
// and present.
#pragma once

#include <memory>

#include "daemon/config/config.hpp"
#include "daemon/loop/event_loop.hpp"
#include "drivers/button.hpp"
#include "drivers/gpio/gpio.hpp"
#include "drivers/indicator.hpp"

namespace plumb {

/// Used on the loop's thread. A configured line that cannot be opened is logged with a remedy and
/// left out; the page's button still works.
class Panel {
 public:
  Panel(EventLoop& loop, const PanelConfig& config);
  ~Panel();
  Panel(const Panel&) = delete;
  Panel& operator=(const Panel&) = delete;

  /// Null if there is none.
  [[nodiscard]] Button* button() { return button_.get(); }
  [[nodiscard]] Indicator* light() { return light_.get(); }
  /// Live monitoring has judged a group of frames. Does nothing without a line.
  void Judge(bool is_in);

 private:
  std::unique_ptr<Button> button_;
  std::unique_ptr<Indicator> light_;
  std::unique_ptr<GpioGate> gate_;
  EventLoop::Source gate_timer_;
};

}  // namespace plumb
