// SPDX-License-Identifier: Apache-2.0
#include "drivers/realsense/realsense_driver.hpp"

#include <memory>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/realsense/realsense_provider.hpp"
#include "words/realsense.hpp"
#ifdef PLUMB_WITH_USB
#include <fmt/format.h>

#include "drivers/usb/usb_sensors.hpp"
#include "words/sensor.hpp"
#endif

namespace plumb {
namespace {

using realsense::RealSenseProvider;
using realsense::RealSenseUnit;
using FindingState = SensorFinding::State;

class RealSenseSetup : public SensorSetup {
 public:
  explicit RealSenseSetup(SensorSettings settings) : settings_(std::move(settings)) {}
  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    return std::make_unique<RealSenseProvider>(settings_);
  }

 private:
  const SensorSettings settings_;
};

/// What is on the bus is said without the library, too.
void ExamineBus(std::vector<SensorFinding>& findings) {
#ifdef PLUMB_WITH_USB
  try {
    for (const UsbSensor& sensor : ListUsbSensors()) {
      if (!IsRealSense(sensor.vendor)) continue;
      const Message found = say::sensor::UsbSensorWithSpeed(
          sensor.model, fmt::format("{:04x}:{:04x}", sensor.vendor, sensor.product), sensor.bus,
          sensor.address, sensor.speed.empty() ? "?" : sensor.speed);
      if (sensor.problems.empty())
        findings.push_back({FindingState::kGood, say::sensor::Usb(), found, {}});
      for (const Message& problem : sensor.problems)
        findings.push_back({FindingState::kBad, say::sensor::Usb(), found, problem});
    }
  } catch (const DeviceError& error) {
    findings.push_back(
        {FindingState::kNote, say::sensor::Usb(), error.message(), say::realsense::UsbNotNeeded()});
  }
#else
  (void)findings;
#endif
}

std::vector<SensorFinding> ExamineRealSense(const SensorSettings& settings) {
  std::vector<SensorFinding> findings;
  ExamineBus(findings);
  try {
    RealSenseProvider provider(settings);
    const auto& library = provider.library();
    findings.push_back({FindingState::kGood,
                        say::realsense::Library(),
                        say::realsense::LibraryFound(library.version(), library.file()),
                        {}});
    for (const RealSenseUnit& unit : provider.Units()) {
      const Message found = say::realsense::Unit(unit.name, unit.serial, unit.firmware, unit.usb);
      if (const auto why = WhyUnusable(unit))
        findings.push_back({FindingState::kBad, say::realsense::Camera(), found, *why});
      else if (const auto advice = FirmwareAdvice(unit))
        findings.push_back({FindingState::kNote, say::realsense::Camera(), found, *advice});
      else
        findings.push_back({FindingState::kGood, say::realsense::Camera(), found, {}});
    }
  } catch (const DeviceError&) {
    // Whoever asks for the sensors next is told why.
  }
  return findings;
}

}  // namespace

void AddRealSenseDriver(SensorRegistry& registry) {
  registry.Add(
      {.name = "realsense",
       .title = "librealsense2",
       .is_simulated = false,
       .set_up = [](const SensorSettings& settings, const SimulatedSweeps&, const std::stop_token&,
                    const SetUpProgress&) { return std::make_unique<RealSenseSetup>(settings); },
       .examine = ExamineRealSense});
}

}  // namespace plumb
