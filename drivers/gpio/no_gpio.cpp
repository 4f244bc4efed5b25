// SPDX-License-Identifier: Apache-2.0
// Button and light in a build without libgpiod: there are none, and asking for one says so.
#include "algo/base/errors.hpp"
#include "drivers/gpio/gpio.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

[[noreturn]] void Refuse() { throw DeviceError(say::sensor::NoGpio()); }

}  // namespace

struct GpioButton::Impl {};

GpioButton::GpioButton(const GpioButtonOptions&) { Refuse(); }
GpioButton::~GpioButton() = default;
int GpioButton::fd() const { Refuse(); }
std::optional<GpioButton::Clock::time_point> GpioButton::deadline() const { return std::nullopt; }
void GpioButton::Dispatch(Clock::time_point) {}
void GpioButton::SetListener(std::function<void(ButtonPress)>) {}

struct GpioIndicator::Impl {};

GpioIndicator::GpioIndicator(const GpioIndicatorOptions&) { Refuse(); }
GpioIndicator::~GpioIndicator() = default;
void GpioIndicator::Show(IndicatorPattern) noexcept {}
std::optional<GpioIndicator::Clock::time_point> GpioIndicator::deadline() const {
  return std::nullopt;
}
void GpioIndicator::Dispatch(Clock::time_point) noexcept {}

struct GpioGate::Impl {};

GpioGate::GpioGate(const GpioGateOptions&) { Refuse(); }
GpioGate::~GpioGate() = default;
void GpioGate::Judge(bool, Clock::time_point) noexcept {}
std::optional<GpioGate::Clock::time_point> GpioGate::deadline() const { return std::nullopt; }
void GpioGate::Dispatch(Clock::time_point) noexcept {}

std::vector<GpioChipDescription> ListGpioChips() { Refuse(); }

}  // namespace plumb
