// SPDX-License-Identifier: Apache-2.0
// Button and light on GPIO lines, identified by the names of chip and line. Everything here is used
// on the event loop's thread only.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "drivers/button.hpp"
#include "drivers/gpio/button_debouncer.hpp"
#include "drivers/gpio/indicator_patterns.hpp"
#include "drivers/indicator.hpp"

namespace plumb {

/// A line of a chip.
struct GpioLineName {
  std::string chip = "gpiochip0";  ///< Name, label, number or path of the chip.
  std::string line;  ///< Name of the line as in the device tree, or its number as `#17`.
};

struct GpioButtonOptions {
  GpioLineName where;
  bool active_low =
      true;  ///< A press pulls the line to ground; the chip's internal pull-up is switched on.
  ButtonDebouncer::Options timing = {};
};

class GpioButton : public Button {
 public:
  /// @throws DeviceError naming chip and line, with a remedy.
  explicit GpioButton(const GpioButtonOptions& options);
  ~GpioButton() override;

  [[nodiscard]] int fd() const override;
  [[nodiscard]] std::optional<Clock::time_point> deadline() const override;
  void Dispatch(Clock::time_point now) override;
  void SetListener(std::function<void(ButtonPress)> pressed) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct GpioIndicatorOptions {
  std::string chip = "gpiochip0";
  /// Red, green, blue; empty if there is no such light. A single light shows all colours.
  std::array<std::string, 3> lights;
  std::string beeper;  ///< Empty if there is none.
  bool active_low = false;
};

/// A line that fails later is ignored from then on: a broken light must not stop a scan.
class GpioIndicator : public Indicator {
 public:
  using Clock = IndicatorPlayer::Clock;
  /// @throws DeviceError naming chip and line, with a remedy.
  explicit GpioIndicator(const GpioIndicatorOptions& options);
  ~GpioIndicator() override;  ///< Switches everything off.

  void Show(IndicatorPattern pattern) noexcept override;
  /// Time of the next Dispatch(); nothing while the light is steady.
  [[nodiscard]] std::optional<Clock::time_point> deadline() const;
  void Dispatch(Clock::time_point now) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct GpioGateOptions {
  GpioLineName where;
  bool active_low = false;
};

/// The line that says `in` to a retriggerable circuit, by edges only: a steady level of either kind
/// means hold.
class GpioGate {
 public:
  using Clock = IndicatorPlayer::Clock;
  /// @throws DeviceError naming chip and line, with a remedy.
  explicit GpioGate(const GpioGateOptions& options);
  ~GpioGate();  ///< Leaves the line low.
  GpioGate(const GpioGate&) = delete;
  GpioGate& operator=(const GpioGate&) = delete;

  /// One judged group of frames: a pulse of 40 ms if it is `in`, otherwise low at once.
  void Judge(bool is_in, Clock::time_point now) noexcept;
  /// End of the pulse.
  [[nodiscard]] std::optional<Clock::time_point> deadline() const;
  void Dispatch(Clock::time_point now) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A chip that exists, for diagnosis.
struct GpioChipDescription {
  std::string name, label;
  std::vector<std::string> lines;  ///< Names of the lines that have one.
  Message problem;                 ///< Why the chip cannot be opened; empty if it can.
};
/// @throws DeviceError if this build has no button and light.
[[nodiscard]] std::vector<GpioChipDescription> ListGpioChips();

}  // namespace plumb
