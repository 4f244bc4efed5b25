// SPDX-License-Identifier: Apache-2.0
#include "drivers/openni/openni_driver.hpp"

#include <memory>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "drivers/openni/openni_provider.hpp"
#include "drivers/program_folders.hpp"
#ifdef PLUMB_WITH_USB
#include "drivers/usb/usb_sensors.hpp"
#include "words/sensor.hpp"
#include "words/stream.hpp"
#endif

namespace plumb {
namespace {

using State = SensorFinding::State;

class OpenNiSetup : public SensorSetup {
 public:
  explicit OpenNiSetup(const SensorSettings& settings) : options_{settings} {}
  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    return std::make_unique<OpenNiProvider>(options_);
  }

 private:
  OpenNiOptions options_;
};

void ExamineUsb(std::vector<SensorFinding>& findings) {
#ifdef PLUMB_WITH_USB
  try {
    const std::vector<UsbSensor> sensors = ListUsbSensors();
    if (sensors.empty()) {
      findings.push_back(
          {State::kNote, say::sensor::Usb(), say::sensor::UsbNone(), say::sensor::UsbPlugIn()});
    }
    for (const UsbSensor& sensor : sensors) {
      const Message found = [&] {
        const std::string id = fmt::format("{:04x}:{:04x}", sensor.vendor, sensor.product);
        return sensor.speed.empty()
                   ? say::sensor::UsbSensorAt(sensor.model, id, sensor.bus, sensor.address)
                   : say::sensor::UsbSensorWithSpeed(sensor.model, id, sensor.bus, sensor.address,
                                                     sensor.speed);
      }();
      if (const UsbDriver other = DriverOf(sensor.vendor, sensor.product); !other.name.empty()) {
        findings.push_back({State::kNote, say::sensor::Usb(), found,
                            say::sensor::UseDriver(other.library, other.name, other.guide)});
      } else if (const std::string sdk = SdkOf(sensor.vendor, sensor.product); !sdk.empty()) {
        findings.push_back({State::kNote, say::sensor::Usb(), found, say::stream::Deliver(sdk)});
      } else if (NeedsForeignDriver(sensor.vendor)) {
        findings.push_back({State::kNote, say::sensor::Usb(), found, say::sensor::ForeignDriver()});
      } else if (sensor.problems.empty()) {
        findings.push_back({State::kGood, say::sensor::Usb(), found, {}});
      }
      for (const Message& problem : sensor.problems)
        findings.push_back(
            {sensor.permitted ? State::kNote : State::kBad, say::sensor::Usb(), found, problem});
    }
  } catch (const DeviceError& error) {
    findings.push_back(
        {State::kNote, say::sensor::Usb(), error.message(), say::sensor::UsbNotNeeded()});
  }
#else
  findings.push_back(
      {State::kNote, say::sensor::Usb(), say::sensor::UsbNotBuilt(), say::sensor::UsbBuild()});
#endif
}

void ExamineDrivers(std::vector<SensorFinding>& findings) {
  const auto folder = OpenNiDriverFolder();
  if (!folder) return;  // the error of loading OpenNI2 states why
  for (const OpenNiDriverFile& driver : FindOpenNiDrivers(*folder)) {
    const Message found = say::sensor::DriverFile(driver.file.string(), driver.serves);
    if (!driver.problem.empty())
      findings.push_back({State::kBad, say::sensor::OpenniDriver(), found, driver.problem});
    else if (driver.is_debians)
      findings.push_back({State::kGood, say::sensor::OpenniDriver(), found, {}});
    else
      findings.push_back(
          {State::kNote, say::sensor::OpenniDriver(), found, say::sensor::DriverUntried()});
  }
}

std::vector<SensorFinding> Examine(const SensorSettings&) {
  std::vector<SensorFinding> findings;
  ExamineUsb(findings);
  ExamineDrivers(findings);
  if (const auto reader = FindBesideProgram("lib/plumb/plumb-oni-reader")) {
    findings.push_back(
        {State::kGood, say::sensor::OniFiles(), Message::Verbatim(reader->string()), {}});
  } else {
    findings.push_back({State::kNote, say::sensor::OniFiles(), say::sensor::OniReaderMissing(),
                        say::sensor::InstallAgain()});
  }
  return findings;
}

}  // namespace

void AddOpenNiDriver(SensorRegistry& registry) {
  registry.Add(
      {.name = "openni",
       .title = "OpenNI2",
       .is_simulated = false,
       .set_up = [](const SensorSettings& settings, const SimulatedSweeps&, const std::stop_token&,
                    const SetUpProgress&) { return std::make_unique<OpenNiSetup>(settings); },
       .examine = Examine});
}

}  // namespace plumb
