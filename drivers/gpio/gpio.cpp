// SPDX-License-Identifier: Apache-2.0
// The only file that uses libgpiod (version 1; version 2 has another interface).
#include "drivers/gpio/gpio.hpp"

#include <gpiod.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <optional>

#include "algo/base/errors.hpp"
#include "words/sensor.hpp"

namespace plumb {

struct GpioChipCloser {
  void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }  // releases its lines too
};
using GpioChip = std::unique_ptr<gpiod_chip, GpioChipCloser>;

namespace {

constexpr char kConsumer[] = "plumb";
constexpr int kMaxEvents =
    64;  // per dispatch; a line that never stops bouncing must not block the loop

Message Reason(int error) {
  if (error == EACCES || error == EPERM) return say::sensor::GpioPermission();
  if (error == EBUSY) return say::sensor::GpioBusy();
  if (error == ENOENT || error == ENODEV) return say::sensor::GpioNone();
  return Message::Verbatim(std::strerror(error));
}

GpioChip OpenChip(const std::string& name) {
  GpioChip chip(gpiod_chip_open_lookup(name.c_str()));
  if (!chip) throw DeviceError(say::sensor::GpioChip(name, Reason(errno)));
  return chip;
}

gpiod_line* FindLine(const GpioChip& chip, const GpioLineName& where) {
  gpiod_line* line = nullptr;
  unsigned number = 0;
  if (where.line.starts_with('#')) {
    const char* end = where.line.data() + where.line.size();
    if (std::from_chars(where.line.data() + 1, end, number).ptr == end)
      line = gpiod_chip_get_line(chip.get(), number);
  } else {
    line = gpiod_chip_find_line(chip.get(), where.line.c_str());
  }
  if (line == nullptr)
    throw DeviceError(say::sensor::GpioLine(where.line, where.chip, say::sensor::GpioNone()));
  return line;
}

}  // namespace

struct GpioButton::Impl {
  GpioChip chip;
  gpiod_line* line = nullptr;
  Message name;
  std::optional<ButtonDebouncer> debouncer;
  std::function<void(ButtonPress)> pressed;
  Clock::time_point last;  ///< Last time passed to the debouncer.

  void Notify(std::optional<ButtonPress> press) const {
    if (press && pressed) pressed(*press);
  }

  /// The time of an event from its stamp, so that a late loop still knows how long the button was
  /// held. Since Linux 5.7 stamps are of the monotonic clock; a stamp of another clock is not
  /// between the last time and now.
  [[nodiscard]] Clock::time_point TimeOf(const gpiod_line_event& event,
                                         Clock::time_point now) const {
    const Clock::time_point stamp{std::chrono::seconds(event.ts.tv_sec) +
                                  std::chrono::nanoseconds(event.ts.tv_nsec)};
    return stamp >= last && stamp <= now ? stamp : now;
  }
};

GpioButton::GpioButton(const GpioButtonOptions& options) : impl_(std::make_unique<Impl>()) {
  impl_->name = say::sensor::ButtonName(options.where.line, options.where.chip);
  impl_->chip = OpenChip(options.where.chip);
  impl_->line = FindLine(impl_->chip, options.where);
  gpiod_line_request_config config{};
  config.consumer = kConsumer;
  config.request_type = GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES;
  config.flags = options.active_low
                     ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW | GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP
                     : GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN;
  if (gpiod_line_request(impl_->line, &config, 0) != 0) {
    config.flags = options.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW
                                      : 0;  // a chip without internal pull resistors
    if (gpiod_line_request(impl_->line, &config, 0) != 0)
      throw DeviceError(say::sensor::ButtonFailed(impl_->name, Reason(errno)));
  }
  const int value = gpiod_line_get_value(impl_->line);
  impl_->last = Clock::now();
  impl_->debouncer.emplace(options.timing, value == 1, impl_->last);
}

GpioButton::~GpioButton() = default;

int GpioButton::fd() const { return gpiod_line_event_get_fd(impl_->line); }

std::optional<GpioButton::Clock::time_point> GpioButton::deadline() const {
  return impl_->debouncer->deadline();
}

void GpioButton::SetListener(std::function<void(ButtonPress)> pressed) {
  impl_->pressed = std::move(pressed);
}

void GpioButton::Dispatch(Clock::time_point now) {
  for (int i = 0; i < kMaxEvents; ++i) {
    pollfd wait{fd(), POLLIN, 0};
    if (::poll(&wait, 1, 0) <= 0) break;
    gpiod_line_event event{};
    if ((wait.revents & POLLIN) == 0 || gpiod_line_event_read(impl_->line, &event) != 0)
      throw DeviceError(say::sensor::ButtonRemoved(impl_->name));
    impl_->last = impl_->TimeOf(event, now);
    impl_->Notify(
        impl_->debouncer->OnEdge(event.event_type == GPIOD_LINE_EVENT_RISING_EDGE, impl_->last));
  }
  impl_->last = now;
  // The kernel buffers 16 edges and drops later ones, so the final level has to be read from the
  // line.
  const int value = gpiod_line_get_value(impl_->line);
  impl_->Notify(value < 0 ? impl_->debouncer->OnTime(now)
                          : impl_->debouncer->OnLevel(value == 1, now));
}

struct GpioIndicator::Impl {
  GpioChip chip;
  std::array<gpiod_line*, 4> lines{};  ///< In the order of the bits of IndicatorOutput.
  int num_lights = 0;
  IndicatorPlayer player;
  std::optional<int> written;  // The outputs that the lines show.

  void Write() noexcept {
    const int outputs = player.outputs();
    if (outputs == written) return;
    written = outputs;
    constexpr int kColours = kRed | kGreen | kBlue;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (lines[i] == nullptr) continue;
      const bool is_light = (1 << i) != kBeeper;
      const bool on =
          is_light && num_lights == 1 ? (outputs & kColours) != 0 : (outputs >> i & 1) != 0;
      (void)gpiod_line_set_value(lines[i], on ? 1 : 0);
    }
  }
};

GpioIndicator::GpioIndicator(const GpioIndicatorOptions& options)
    : impl_(std::make_unique<Impl>()) {
  impl_->chip = OpenChip(options.chip);
  const std::array<std::string, 4> names{options.lights[0], options.lights[1], options.lights[2],
                                         options.beeper};
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i].empty()) continue;
    gpiod_line* line = FindLine(impl_->chip, {options.chip, names[i]});
    const int flags = options.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
    if (gpiod_line_request_output_flags(line, kConsumer, flags, 0) != 0)
      throw DeviceError(say::sensor::LightFailed(names[i], options.chip, Reason(errno)));
    impl_->lines[i] = line;
    impl_->num_lights += i < options.lights.size() ? 1 : 0;
  }
}

GpioIndicator::~GpioIndicator() { Show(IndicatorPattern::kOff); }

void GpioIndicator::Show(IndicatorPattern pattern) noexcept {
  impl_->player.Show(pattern, Clock::now());
  impl_->Write();
}

std::optional<GpioIndicator::Clock::time_point> GpioIndicator::deadline() const {
  return impl_->player.deadline();
}

void GpioIndicator::Dispatch(Clock::time_point now) noexcept {
  impl_->player.OnTime(now);
  impl_->Write();
}

struct GpioGate::Impl {
  GpioChip chip;
  gpiod_line* line = nullptr;
  std::optional<Clock::time_point> pulse_ends;

  void Set(bool high) noexcept { (void)gpiod_line_set_value(line, high ? 1 : 0); }
};

GpioGate::GpioGate(const GpioGateOptions& options) : impl_(std::make_unique<Impl>()) {
  impl_->chip = OpenChip(options.where.chip);
  impl_->line = FindLine(impl_->chip, options.where);
  const int flags = options.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  if (gpiod_line_request_output_flags(impl_->line, kConsumer, flags, 0) != 0)
    throw DeviceError(
        say::sensor::LightFailed(options.where.line, options.where.chip, Reason(errno)));
}

GpioGate::~GpioGate() { impl_->Set(false); }

void GpioGate::Judge(bool is_in, Clock::time_point now) noexcept {
  constexpr std::chrono::milliseconds kPulse{40};
  if (is_in) {
    if (impl_->pulse_ends) return;  // a rising edge needs a low level before it
    impl_->Set(true);
    impl_->pulse_ends = now + kPulse;
    return;
  }
  if (!impl_->pulse_ends) return;
  impl_->Set(false);
  impl_->pulse_ends.reset();
}

std::optional<GpioGate::Clock::time_point> GpioGate::deadline() const { return impl_->pulse_ends; }

void GpioGate::Dispatch(Clock::time_point now) noexcept {
  if (!impl_->pulse_ends || now < *impl_->pulse_ends) return;
  impl_->Set(false);
  impl_->pulse_ends.reset();
}

std::vector<GpioChipDescription> ListGpioChips() {
  std::vector<GpioChipDescription> chips;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/dev", error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("gpiochip")) continue;
    GpioChipDescription& description = chips.emplace_back();
    description.name = name;
    const GpioChip chip(gpiod_chip_open(entry.path().c_str()));
    if (!chip) {
      description.problem = Reason(errno);
      continue;
    }
    description.label = gpiod_chip_label(chip.get());
    for (unsigned i = 0; i < gpiod_chip_num_lines(chip.get()); ++i) {
      gpiod_line* line = gpiod_chip_get_line(chip.get(), i);
      if (line != nullptr && gpiod_line_name(line) != nullptr)
        description.lines.emplace_back(gpiod_line_name(line));
    }
  }
  std::sort(chips.begin(), chips.end(),
            [](const auto& a, const auto& b) { return a.name < b.name; });
  return chips;
}

}  // namespace plumb
