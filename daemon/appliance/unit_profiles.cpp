// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/unit_profiles.hpp"

#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/files/sensor_profile_file.hpp"
#include "words/scan.hpp"

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

UnitProfiles::UnitProfiles(const Config& config, std::function<SensorSnapshot()> sensor)
    : sensor_(std::move(sensor)),
      shelf_(std::make_shared<ProfileShelf>(config.appliance.state / "sensor-profiles")) {
  Configure(config);
}

void UnitProfiles::Configure(const Config& config) {
  is_off_ = !config.appliance.sensor_profiles || config.reconstruct.preset != Preset::kBest;
}

std::string OwnSerial(const SensorDescription& sensor) {
  return sensor.serial == sensor.uri ? std::string() : sensor.serial;
}

/// Empty if a profile is kept.
Message UnitProfiles::WhyNone(const SensorDescription& sensor) const {
  if (is_off_) return say::scan::ProfilesOff();
  if (OwnSerial(sensor).empty()) return say::scan::NoSerial();
  return {};
}

/// Null if no profile is kept.
std::shared_ptr<UnitProfile> UnitProfiles::ForScan() const {
  const SensorSnapshot sensor = sensor_();
  if (!WhyNone(sensor.sensor).empty()) return nullptr;
  return std::make_shared<UnitProfile>(shelf_, sensor.sensor.serial, sensor.info.intrinsics);
}

SensorProfiles UnitProfiles::OfConnected() const {
  const SensorSnapshot sensor = sensor_();
  SensorProfiles shown;
  if (!sensor.present) {
    shown.why_none = say::scan::NoSensor();
    return shown;
  }
  shown.serial = sensor.sensor.serial;
  shown.why_none = WhyNone(sensor.sensor);
  if (!shown.why_none.empty()) return shown;
  for (const ProfileVersion& version : shelf_->Versions(shown.serial))
    shown.versions.push_back(Shown(version));
  return shown;
}

std::optional<std::string> UnitProfiles::FileOf(int version) const {
  const SensorSnapshot sensor = sensor_();
  if (!sensor.present || !WhyNone(sensor.sensor).empty()) return std::nullopt;
  for (const ProfileVersion& one : shelf_->Versions(sensor.sensor.serial))
    if (one.version == version && one.profile) return SensorProfileJson(*one.profile);
  return std::nullopt;
}

Message UnitProfiles::WhyNotChange(const std::string& serial) const {
  const SensorSnapshot sensor = sensor_();
  if (!sensor.present || sensor.sensor.serial != serial) return say::scan::OtherSensor(serial);
  return WhyNone(sensor.sensor);
}

}  // namespace plumb
