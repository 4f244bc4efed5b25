// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/unit/doctor_sensor.hpp"

#include <optional>
#include <vector>

#include "algo/base/errors.hpp"
#include "daemon/config/sensor_settings.hpp"
#include "drivers/live/sensor_calibration.hpp"
#include "words/doctor.hpp"

namespace plumb {
namespace {

/// The calibration of one attached sensor.
void CheckCalibration(DoctorReport& report, const SensorDriver& driver,
                      const SensorSettings& settings, const std::string& serial) try {
  const std::string file = CalibrationFile(settings.calibration_folder, serial).string();
  const std::optional<StreamInfo> stated = StatedCalibration(settings, serial);
  if (!stated) {
    if (driver.states_camera)
      report.Good(say::doctor::Calibration(), say::doctor::OwnCalibration(serial));
    else
      report.Note(say::doctor::Calibration(), say::doctor::NotCalibrated(serial),
                  say::doctor::CalibrateUnit(file));
    return;
  }
  // Only where the size of the images is known can the file be of another shape.
  if (!driver.states_camera) (void)LiveStreamInfo(settings, serial, 640, 480, 0.0);
  const Intrinsics& camera = stated->intrinsics;
  report.Good(say::doctor::Calibration(),
              say::doctor::Calibrated(file, camera.width, camera.height, camera.fx));
} catch (const DeviceError& problem) {
  report.Bad(say::doctor::Calibration(), problem.message(), {});
}

}  // namespace

void CheckAttached(DoctorReport& report, const SensorDriver& driver, const SensorSettings& settings,
                   const std::string& wanted) {
  const auto setup = driver.set_up(settings, {}, {}, {});
  const auto provider = setup->MakeProvider();
  const std::vector<SensorDescription> sensors = provider->List();
  report.Good(Message::Verbatim(driver.title),
              say::doctor::Loaded(static_cast<std::int64_t>(sensors.size())));
  if (sensors.empty())
    report.Bad(say::doctor::Sensor(), say::doctor::NoSensor(), say::doctor::PlugIn());
  bool found_wanted = wanted.empty();
  for (const SensorDescription& sensor : sensors) {
    found_wanted = found_wanted || sensor.serial == wanted;
    report.Good(say::doctor::Sensor(), say::doctor::Attached(sensor.name, sensor.serial));
    CheckCalibration(report, driver, settings, sensor.serial);
  }
  if (!found_wanted && !sensors.empty())
    report.Bad(say::doctor::Sensor(), say::doctor::OtherSerial(wanted), say::doctor::PlugInThat());
}

void CheckSensor(DoctorReport& report, const Config& config) try {
  const SensorDriver& driver = BuiltInSensors().Choose(config.appliance.sensor_driver, false);
  const SensorSettings settings = SensorSettingsOf(config);
  if (driver.examine) {
    for (const SensorFinding& finding : driver.examine(settings)) {
      if (finding.state == SensorFinding::State::kGood)
        report.Good(finding.what, finding.found);
      else if (finding.state == SensorFinding::State::kNote)
        report.Note(finding.what, finding.found, finding.remedy);
      else
        report.Bad(finding.what, finding.found, finding.remedy);
    }
  }
  try {
    CheckAttached(report, driver, settings, config.appliance.sensor_serial);
  } catch (const DeviceError& error) {
    report.Bad(Message::Verbatim(driver.title), error.message(), {});
  }
} catch (const DataError& problem) {
  report.Bad(say::doctor::Configuration(), problem.message(), {}, kBadInput);
}

}  // namespace plumb
