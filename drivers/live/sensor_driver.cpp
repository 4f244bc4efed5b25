// SPDX-License-Identifier: Apache-2.0
#include "drivers/live/sensor_driver.hpp"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/sensor_model/depth_noise.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

class NoSensors : public SensorSetup {
 public:
  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    throw DeviceError(say::sensor::NoDriver());
  }
};

const SensorDriver& NoDriver() {
  static const SensorDriver driver{
      .name = "none",
      .title = "no driver",
      .set_up = [](const SensorSettings&, const SimulatedSweeps&, const std::stop_token&,
                   const SetUpProgress&) { return std::make_unique<NoSensors>(); }};
  return driver;
}

}  // namespace

std::string SensorSetup::Command(const std::string& command) const {
  throw DeviceError(say::sensor::NotSimulated(command));
}

std::unique_ptr<LiveSensor> OpenSensor(SensorProvider& provider, const std::string& serial) {
  std::unique_ptr<LiveSensor> sensor = provider.Open(serial);
  if (const std::optional<Message> fault = FaultOf(sensor->info().depth_noise)) {
    throw DeviceError(say::sensor::DriverStatesNoise(sensor->description().serial, *fault));
  }
  return sensor;
}

void SensorRegistry::Add(SensorDriver driver) {
  const bool is_known = std::any_of(drivers_.begin(), drivers_.end(),
                                    [&](const auto& known) { return known.name == driver.name; });
  if (driver.name.empty() || is_known || !driver.set_up) {
    throw std::invalid_argument(
        fmt::format("sensor driver \"{}\": expected a name that is not taken and a set_up function",
                    driver.name));
  }
  drivers_.push_back(std::move(driver));
}

void SensorRegistry::Add(std::unique_ptr<const RecordingKind> kind) {
  kinds_.push_back(std::move(kind));
}

const SensorDriver& SensorRegistry::Choose(const std::string& name, bool simulated) const {
  std::vector<std::string> known;
  for (const SensorDriver& driver : drivers_) {
    if (driver.is_simulated == simulated && (name.empty() || driver.name == name)) return driver;
    if (driver.is_simulated == simulated) known.push_back(fmt::format("\"{}\"", driver.name));
  }
  if (name.empty()) return NoDriver();
  const bool is_other_kind = std::any_of(drivers_.begin(), drivers_.end(),
                                         [&](const auto& driver) { return driver.name == name; });
  const Message expected =
      known.empty() ? say::sensor::NoSuchDriver() : say::sensor::Drivers(std::move(known));
  if (is_other_kind)
    throw DataError(simulated ? say::sensor::DriverOfReal(name, expected)
                              : say::sensor::DriverOfSimulated(name, expected));
  throw DataError(say::sensor::UnknownDriver(expected, name));
}

const RecordingKind* SensorRegistry::KindWithExtension(std::string_view extension) const {
  for (const auto& kind : kinds_)
    if (kind->extension() == extension) return kind.get();
  return nullptr;
}

const RecordingKind* SensorRegistry::KindOf(const std::filesystem::path& file) const {
  for (const auto& kind : kinds_)
    if (kind->IsOne(file)) return kind.get();
  return nullptr;
}

}  // namespace plumb
