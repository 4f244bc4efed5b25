// SPDX-License-Identifier: Apache-2.0
#include "tests/devices/openni_driver/virtual_openni_driver.hpp"

#include <memory>
#include <stop_token>
#include <string>

#include "drivers/openni/openni_provider.hpp"
#include "tests/devices/openni_driver/virtual_sensor.hpp"

namespace plumb {
namespace {

class VirtualOpenNiSetup : public SensorSetup {
 public:
  VirtualOpenNiSetup(const SensorSettings& settings, const SimulatedSweeps& sweeps,
                     const std::stop_token& stop, const SetUpProgress& progress)
      : sensor_(VirtualSensorOptions{sweeps}, stop, progress), options_{settings} {
    options_.library = sensor_.runtime_library();
    options_.calibration_folder = sensor_.calibration_folder();
    options_.markers_are_the_rooms = false;
    options_.before_stop = [this] { sensor_.Quit(); };
  }

  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    return std::make_unique<OpenNiProvider>(options_);
  }
  void BeforeScan() const override { (void)sensor_.Command("rewind"); }
  std::string Command(const std::string& command) const override {
    return sensor_.Command(command);
  }

 private:
  VirtualSensor sensor_;
  OpenNiOptions options_;
};

}  // namespace

void AddVirtualOpenNiDriver(SensorRegistry& registry) {
  registry.Add({.name = "virtual-openni",
                .title = "virtual sensor through OpenNI2",
                .is_simulated = true,
                .set_up = [](const SensorSettings& settings, const SimulatedSweeps& sweeps,
                             const std::stop_token& stop, const SetUpProgress& progress) {
                  return std::make_unique<VirtualOpenNiSetup>(settings, sweeps, stop, progress);
                }});
}

}  // namespace plumb
