#include "drivers/live/sensor_driver.hpp"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "algo/base/errors.hpp"
#include "algo/types/depth_noise.hpp"

namespace plumb {
namespace {

class NoSensors : public SensorSetup {
 public:
  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    throw DeviceError(
        "this build has no driver of that kind of sensor: no sensor can be used; build with "
        "PLUMB_WITH_OPENNI");
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
  throw DeviceError(
      fmt::format("sim {}: there is no virtual sensor; start plumbd with --simulated", command));
}

std::unique_ptr<LiveSensor> OpenSensor(SensorProvider& provider, const std::string& serial) {
  std::unique_ptr<LiveSensor> sensor = provider.Open(serial);
  if (const std::optional<std::string> fault = FaultOf(sensor->info().depth_noise)) {
    throw DeviceError(fmt::format(
        "the driver of sensor {} states a depth noise that cannot be used: {}; correct the driver",
        sensor->description().serial, *fault));
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
  const std::string expected = known.empty() ? "none, this build has no such driver"
                                             : fmt::format("{}", fmt::join(known, ", "));
  if (is_other_kind && simulated) {
    throw DataError(
        fmt::format("[sensor] driver: \"{}\" reads real sensors, but a simulated one is requested; "
                    "expected one of {}; remove the key or --simulated",
                    name, expected));
  }
  if (is_other_kind) {
    throw DataError(fmt::format(
        "[sensor] driver: \"{}\" shows simulated images and is taken with --simulated only; "
        "expected one of {}",
        name, expected));
  }
  throw DataError(fmt::format(
      "[sensor] driver: expected one of {}, found \"{}\"; correct the name, or build Plumb with "
      "that driver",
      expected, name));
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
