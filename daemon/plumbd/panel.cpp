// SPDX-License-Identifier: Apache-2.0
#include "daemon/plumbd/panel.hpp"

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/loop/log.hpp"
#include "drivers/gpio/gpio.hpp"

namespace plumb {
namespace {

/// Blinks by a timer of the loop.
class BlinkingLight : public Indicator {
 public:
  BlinkingLight(EventLoop& loop, const GpioIndicatorOptions& options) : light_(options) {
    timer_ = loop.MakeTimer("light", [this] {
      light_.Dispatch(GpioIndicator::Clock::now());
      Arm();
    });
  }
  void Show(IndicatorPattern pattern) noexcept override {
    light_.Show(pattern);
    Arm();
  }

 private:
  void Arm() noexcept {
    try {
      if (const auto deadline = light_.deadline()) {
        timer_.ArmAt(*deadline);
      } else {
        timer_.Disarm();
      }
    } catch (const std::exception&) {  // the light freezes, which must not stop a scan
    }
  }

  GpioIndicator light_;
  EventLoop::Source timer_;
};

}  // namespace

Panel::Panel(EventLoop& loop, const PanelConfig& config) {
  try {
    if (!config.button_line.empty()) {
      GpioButtonOptions options;
      options.where = {.chip = config.button_chip, .line = config.button_line};
      options.active_low = config.button_active_low;
      button_ = std::make_unique<GpioButton>(options);
    }
  } catch (const DeviceError& error) {
    Log(LogLevel::kError, fmt::format("no hardware button: {}", error.what()));
  }
  try {
    if (!config.gate_line.empty()) {
      gate_ = std::make_unique<GpioGate>(
          GpioGateOptions{.where = {.chip = config.gate_chip, .line = config.gate_line},
                          .active_low = config.gate_active_low});
      gate_timer_ = loop.MakeTimer("gate", [this] { gate_->Dispatch(GpioGate::Clock::now()); });
    }
  } catch (const DeviceError& error) {
    Log(LogLevel::kError, fmt::format("no gate line: {}", error.what()));
  }
  const bool has_light = !config.red_line.empty() || !config.green_line.empty() ||
                         !config.blue_line.empty() || !config.beeper_line.empty();
  try {
    if (!has_light) return;
    GpioIndicatorOptions options;
    options.chip = config.light_chip;
    options.lights = {config.red_line, config.green_line, config.blue_line};
    options.beeper = config.beeper_line;
    options.active_low = config.light_active_low;
    light_ = std::make_unique<BlinkingLight>(loop, options);
  } catch (const DeviceError& error) {
    Log(LogLevel::kError, fmt::format("no light: {}", error.what()));
  }
}

Panel::~Panel() = default;

void Panel::Judge(bool is_in) {
  if (!gate_) return;
  gate_->Judge(is_in, GpioGate::Clock::now());
  if (const auto deadline = gate_->deadline()) {
    gate_timer_.ArmAt(*deadline);
  } else {
    gate_timer_.Disarm();
  }
}

}  // namespace plumb
