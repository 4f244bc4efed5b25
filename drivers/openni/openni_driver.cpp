#include "drivers/openni/openni_driver.hpp"

#include <memory>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "drivers/openni/openni_provider.hpp"
#include "drivers/program_folders.hpp"
#ifdef PLUMB_WITH_USB
#include "drivers/usb/usb_sensors.hpp"
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
      findings.push_back({State::kNote, "USB", "no sensor that OpenNI2 has a driver for",
                          "plug one in; its own lamp must light up"});
    }
    for (const UsbSensor& sensor : sensors) {
      const std::string found = fmt::format(
          "{} {:04x}:{:04x} at bus {} address {}{}{}", sensor.model, sensor.vendor, sensor.product,
          sensor.bus, sensor.address, sensor.speed.empty() ? "" : ", ", sensor.speed);
      if (NeedsForeignDriver(sensor.vendor)) {
        findings.push_back({State::kNote, "USB", found,
                            "it needs its maker's driver for OpenNI2, in the folder of the drivers "
                            "below; not tried with Plumb"});
      } else if (sensor.problems.empty()) {
        findings.push_back({State::kGood, "USB", found, {}});
      }
      for (const std::string& problem : sensor.problems)
        findings.push_back({sensor.permitted ? State::kNote : State::kBad, "USB", found, problem});
    }
  } catch (const DeviceError& error) {
    findings.push_back(
        {State::kNote, "USB", error.what(), "sensors are found through OpenNI2 all the same"});
  }
#else
  findings.push_back({State::kNote, "USB", "this build cannot examine the bus",
                      "build with PLUMB_WITH_USB for permissions and speeds"});
#endif
}

void ExamineDrivers(std::vector<SensorFinding>& findings) {
  const auto folder = OpenNiDriverFolder();
  if (!folder) return;  // the error of loading OpenNI2 states why
  for (const OpenNiDriverFile& driver : FindOpenNiDrivers(*folder)) {
    const std::string found = fmt::format("{}: {}", driver.file.string(), driver.serves);
    if (!driver.problem.empty())
      findings.push_back({State::kBad, "OpenNI2 driver", found, driver.problem});
    else if (driver.is_debians)
      findings.push_back({State::kGood, "OpenNI2 driver", found, {}});
    else
      findings.push_back({State::kNote, "OpenNI2 driver", found,
                          "not tried with Plumb: calibrate the sensor, and check a known motion "
                          "before it is used"});
  }
}

std::vector<SensorFinding> Examine() {
  std::vector<SensorFinding> findings;
  ExamineUsb(findings);
  ExamineDrivers(findings);
  if (const auto reader = FindBesideProgram("lib/plumb/plumb-oni-reader")) {
    findings.push_back({State::kGood, ".oni files", reader->string(), {}});
  } else {
    findings.push_back({State::kNote, ".oni files",
                        "plumb-oni-reader is missing: recordings of OpenNI2 cannot be read",
                        "install Plumb again"});
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
