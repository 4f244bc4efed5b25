// SPDX-License-Identifier: Apache-2.0
#include "drivers/sdk/sdk_host.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "words/sdk.hpp"
#include "words/sensor.hpp"
#ifdef PLUMB_WITH_USB
#include "drivers/usb/usb_sensors.hpp"
#endif

namespace plumb {
namespace {

using FindingState = SensorFinding::State;

// Depth and colour are not synchronised: less than half a period of 33.3 ms.
constexpr std::chrono::microseconds kLargestSdkGap{16000};
constexpr std::chrono::milliseconds kSdkStallTime{3000};

class SdkProvider : public SensorProvider {
 public:
  explicit SdkProvider(std::shared_ptr<SdkHost> host) : host_(std::move(host)) {}
  ~SdkProvider() override { host_->events().SetListener(nullptr); }

  [[nodiscard]] std::vector<SensorDescription> List() override {
    std::vector<SensorDescription> sensors;
    for (const SdkAttached& one : Sorted()) sensors.push_back(host_->DescriptionOf(one.unit));
    return sensors;
  }
  void SetListener(std::function<void()> changed) override {
    host_->events().SetListener(std::move(changed));
  }
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::string& serial) override;

 private:
  [[nodiscard]] std::vector<SdkAttached> Sorted() {
    std::vector<SdkAttached> attached = host_->Attached();
    std::ranges::sort(attached, {}, [](const SdkAttached& a) { return a.unit.serial; });
    return attached;
  }

  const std::shared_ptr<SdkHost> host_;
};

std::unique_ptr<LiveSensor> SdkProvider::Open(const std::string& serial) {
  const std::vector<SdkAttached> attached = Sorted();
  std::vector<SensorDescription> sensors;
  for (const SdkAttached& one : attached) sensors.push_back(host_->DescriptionOf(one.unit));
  const SensorDescription found = ChooseSensor(sensors, serial);
  const SdkAttached& chosen = *std::ranges::find(
      attached, found.serial, [](const SdkAttached& a) { return a.unit.serial; });
  if (const std::optional<Message> why = WhyUnusable(chosen.unit)) throw DeviceError(*why);
  auto box = std::make_shared<FrameBox>(found.serial, kLargestSdkGap, kSdkStallTime);
  auto watched = SdkHost::Watch(host_, chosen, box);
  auto sensor = host_->Open(host_, {chosen, found, box, std::move(watched)});
  if (box->lost()) throw DeviceLost(say::sensor::UnpluggedWhileOpened(found.serial));
  return sensor;
}

class SdkSetup : public SensorSetup {
 public:
  SdkSetup(SensorSettings settings, MakeSdkHost make)
      : settings_(std::move(settings)), make_(std::move(make)) {}
  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    return std::make_unique<SdkProvider>(make_(settings_));
  }

 private:
  const SensorSettings settings_;
  const MakeSdkHost make_;
};

/// What is on the bus is said without the library, too.
void ExamineSdkBus(const std::string& driver, const SdkTitle& title,
                   std::vector<SensorFinding>& findings) {
#ifdef PLUMB_WITH_USB
  try {
    for (const UsbSensor& sensor : ListUsbSensors()) {
      if (DriverOf(sensor.vendor, sensor.product).name != driver) continue;
      const Message found = say::sensor::UsbSensorWithSpeed(
          sensor.model, fmt::format("{:04x}:{:04x}", sensor.vendor, sensor.product), sensor.bus,
          sensor.address, sensor.speed.empty() ? "?" : sensor.speed);
      if (sensor.problems.empty())
        findings.push_back({FindingState::kGood, say::sensor::Usb(), found, {}});
      for (const Message& problem : sensor.problems)
        findings.push_back({FindingState::kBad, say::sensor::Usb(), found, problem});
    }
  } catch (const DeviceError& error) {
    findings.push_back({FindingState::kNote, say::sensor::Usb(), error.message(),
                        say::sdk::UsbNotNeeded(title.name)});
  }
#else
  (void)driver, (void)title, (void)findings;
#endif
}

SensorFinding FindingOf(const SdkUnit& unit, const std::string& sdk) {
  const Message found = unit.firmware.empty() || unit.usb.empty()
                            ? say::sdk::PlainUnit(unit.name, unit.serial)
                            : say::sdk::Unit(unit.name, unit.serial, unit.firmware, unit.usb);
  if (const auto why = WhyUnusable(unit))
    return {FindingState::kBad, say::sdk::Camera(), found, *why};
  if (const auto advice = FirmwareAdvice(unit, sdk))
    return {FindingState::kNote, say::sdk::Camera(), found, *advice};
  return {FindingState::kGood, say::sdk::Camera(), found, {}};
}

std::vector<SensorFinding> ExamineSdk(const std::string& driver, const SdkTitle& title,
                                      const MakeSdkHost& make, const SensorSettings& settings) {
  std::vector<SensorFinding> findings;
  ExamineSdkBus(driver, title, findings);
  try {
    const std::shared_ptr<SdkHost> host = make(settings);
    const SdkLibrary& library = host->library();
    findings.push_back({FindingState::kGood,
                        say::sdk::Library(),
                        say::sdk::LibraryFound(title.name, library.version(), library.file()),
                        {}});
    for (const SdkAttached& one : host->Attached())
      findings.push_back(FindingOf(one.unit, title.name));
  } catch (const DeviceError&) {
    // Whoever asks for the sensors next is told why.
  }
  return findings;
}

}  // namespace

SensorDescription SdkHost::DescriptionOf(const SdkUnit& unit) {
  const std::lock_guard lock(mutex_);
  return {.uri = fmt::format("{}:{}:{}", scheme_, unit.serial, times_unplugged_[unit.serial]),
          .serial = unit.serial,
          .name = unit.name.empty() ? unit.serial : unit.name};
}

std::shared_ptr<const void> SdkHost::Watch(const std::shared_ptr<SdkHost>& self,
                                           const SdkAttached& attached,
                                           const std::shared_ptr<FrameBox>& box) {
  const std::string uri = self->DescriptionOf(attached.unit).uri;
  self->events_.Watch(uri, box);
  const std::lock_guard lock(self->mutex_);
  const std::uintptr_t number = self->next_watch_++;
  self->watched_.emplace(number, Watched{attached.unit.serial, uri, attached.device});
  return {nullptr, [self, number, device = attached.device](std::nullptr_t) {
            const std::lock_guard again(self->mutex_);
            self->watched_.erase(number);
          }};
}

void SdkHost::Lose(const std::function<bool(const Watched&)>& is_gone) {
  std::vector<std::string> lost;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [number, watched] : watched_) {
      if (!is_gone(watched)) continue;
      lost.push_back(watched.uri);
      ++times_unplugged_[watched.serial];
    }
  }
  for (const std::string& uri : lost) events_.Lose(uri);
}

void AddSdkDriver(SensorRegistry& registry, const std::string& name, const SdkTitle& title,
                  MakeSdkHost make) {
  registry.Add({.name = name,
                .title = title.name,
                .is_simulated = false,
                .states_camera = title.states_camera,
                .set_up = [make](const SensorSettings& settings, const SimulatedSweeps&,
                                 const std::stop_token&,
                                 const SetUpProgress&) -> std::unique_ptr<SensorSetup> {
                  return std::make_unique<SdkSetup>(settings, make);
                },
                .examine =
                    [name, title, make](const SensorSettings& settings) {
                      return ExamineSdk(name, title, make, settings);
                    }});
}

}  // namespace plumb
