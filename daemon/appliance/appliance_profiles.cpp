// Sensor profiles of the appliance: for which units they are kept, and what the page shows and
// changes.
#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/files/sensor_profile_file.hpp"

namespace plumb {
namespace {

SensorProfileVersion Shown(const ProfileVersion& version) {
  SensorProfileVersion shown{.version = version.version,
                             .made_at = version.made,
                             .cause = version.cause,
                             .num_sweeps = 0,
                             .values = {}};
  if (!version.profile) return shown;
  CalibrationModel model;
  MoveCalibration(version.profile->mean, model);
  shown.num_sweeps = version.profile->num_sweeps;
  shown.values = model.Named();
  return shown;
}

}  // namespace

bool Appliance::ProfilesOff(const Config& config) {
  return !config.appliance.sensor_profiles || config.reconstruct.preset != Preset::kBest;
}

std::string Appliance::OwnSerial(const SensorDescription& sensor) {
  return sensor.serial == sensor.uri ? std::string() : sensor.serial;
}

/// Empty if a profile is kept.
std::string Appliance::WhyNoProfile(const SensorDescription& sensor) const {
  if (profiles_off_) return "profiles are switched off in the configuration";
  if (OwnSerial(sensor).empty()) return "it has no serial by which it would be known again";
  return {};
}

/// Null if no profile is kept.
std::shared_ptr<UnitProfile> Appliance::MakeUnitProfile() {
  const SensorSnapshot sensor = sensors_->snapshot();
  if (!WhyNoProfile(sensor.sensor).empty()) return nullptr;
  return std::make_shared<UnitProfile>(profiles_, sensor.sensor.serial, sensor.info.intrinsics);
}

SensorProfiles Appliance::UnitProfiles() const {
  const SensorSnapshot sensor = sensors_->snapshot();
  SensorProfiles shown;
  if (!sensor.present) {
    shown.why_none = "no sensor is attached";
    return shown;
  }
  shown.serial = sensor.sensor.serial;
  shown.why_none = WhyNoProfile(sensor.sensor);
  if (!shown.why_none.empty()) return shown;
  for (const ProfileVersion& version : profiles_->Versions(shown.serial))
    shown.versions.push_back(Shown(version));
  return shown;
}

std::optional<std::string> Appliance::SensorProfileFile(int version) const {
  const SensorSnapshot sensor = sensors_->snapshot();
  if (!sensor.present || !WhyNoProfile(sensor.sensor).empty()) return std::nullopt;
  for (const ProfileVersion& one : profiles_->Versions(sensor.sensor.serial))
    if (one.version == version && one.profile) return SensorProfileJson(*one.profile);
  return std::nullopt;
}

Appliance::Answer Appliance::WhyNotChangeProfile(const std::string& serial) const {
  if (std::string why = WhyNotIdle(); !why.empty()) return why;
  const SensorSnapshot sensor = sensors_->snapshot();
  if (!sensor.present || sensor.sensor.serial != serial)
    return fmt::format("the sensor {} is not connected: look at this page again", serial);
  return WhyNoProfile(sensor.sensor);
}

void Appliance::ForgetDrift() {
  profile_fault_.clear();
  NotifyWeb(web::EventKind::kStatus);
}

}  // namespace plumb
