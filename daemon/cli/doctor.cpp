// `plumb doctor`: checks what is attached, permitted and configured, and gives advice for what is
// not; on request a burn-in. It does not change stored data. Its exit code shows whether something
// necessary is missing.
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/burn_in.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/doctor_report.hpp"
#include "daemon/config/config.hpp"
#include "daemon/config/sensor_settings.hpp"
#include "daemon/control/unix_socket.hpp"
#include "drivers/gpio/gpio.hpp"
#include "drivers/live/sensor_calibration.hpp"
#include "drivers/live/sensor_driver.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

Config CheckConfig(DoctorReport& report, const std::optional<fs::path>& wanted) {
  const fs::path file = wanted.value_or(kDefaultConfig);
  std::error_code error;
  if (!wanted && !fs::exists(file, error)) {
    report.Note("configuration", fmt::format("no {}: using defaults", file.string()),
                "write one where the defaults do not fit");
    return {};
  }
  try {
    Config config = ReadConfig(file, ConfigUse::kAppliance);
    report.Good("configuration", file.string());
    return config;
  } catch (const DataError& problem) {
    report.Bad("configuration", problem.what(),
               "correct it; `plumbd --check-config` confirms when it is right", kBadInput);
    return {};
  }
}

/// The calibration of one attached sensor.
void CheckCalibration(DoctorReport& report, const SensorSettings& settings,
                      const std::string& serial) {
  const fs::path file = CalibrationFile(settings.calibration_folder, serial);
  std::error_code error;
  if (!fs::exists(file, error)) {
    report.Note("calibration", fmt::format("none for {}: nominal intrinsics are used", serial),
                fmt::format("calibrate the unit and put its camera.yaml at {}", file.string()));
    return;
  }
  try {
    const StreamInfo info = LiveStreamInfo(settings, serial, 640, 480, 0.0);
    report.Good("calibration",
                fmt::format("{}, focal length {:.1f} pixels", file.string(), info.intrinsics.fx));
  } catch (const DeviceError& problem) {
    report.Bad("calibration", problem.what(), "");
  }
}

void CheckAttached(DoctorReport& report, const SensorDriver& driver, const SensorSettings& settings,
                   const std::string& wanted) {
  const auto setup = driver.set_up(settings, {}, {}, {});
  const auto provider = setup->MakeProvider();
  const std::vector<SensorDescription> sensors = provider->List();
  report.Good(driver.title,
              fmt::format("loaded, {} sensor{}", sensors.size(), sensors.size() == 1 ? "" : "s"));
  if (sensors.empty())
    report.Bad("sensor", "none is attached", "plug one in; look at USB above if it is");
  bool found_wanted = wanted.empty();
  for (const SensorDescription& sensor : sensors) {
    found_wanted = found_wanted || sensor.serial == wanted;
    report.Good("sensor", fmt::format("{}, serial {}", sensor.name, sensor.serial));
    CheckCalibration(report, settings, sensor.serial);
  }
  if (!found_wanted && !sensors.empty())
    report.Bad("sensor", fmt::format("the configuration wants serial {}", wanted),
               "plug that one in, or change sensor_serial");
}

void CheckSensor(DoctorReport& report, const Config& config) try {
  const SensorDriver& driver = BuiltInSensors().Choose(config.appliance.sensor_driver, false);
  if (driver.examine) {
    for (const SensorFinding& finding : driver.examine()) {
      if (finding.state == SensorFinding::State::kGood)
        report.Good(finding.what, finding.found);
      else if (finding.state == SensorFinding::State::kNote)
        report.Note(finding.what, finding.found, finding.remedy);
      else
        report.Bad(finding.what, finding.found, finding.remedy);
    }
  }
  const SensorSettings settings = SensorSettingsOf(config);
  try {
    CheckAttached(report, driver, settings, config.appliance.sensor_serial);
  } catch (const DeviceError& error) {
    report.Bad(driver.title, error.what(), "");
  }
} catch (const DataError& problem) {
  report.Bad("configuration", problem.what(), "", kBadInput);
}

void CheckGpio(DoctorReport& report) try {
  const std::vector<GpioChipDescription> chips = ListGpioChips();
  if (chips.empty())
    report.Note("GPIO", "no chip: no hardware button and light",
                "use the page's button, `plumb press` or a board with GPIO");
  for (const GpioChipDescription& chip : chips) {
    if (chip.problem.empty())
      report.Good("GPIO", fmt::format("{} \"{}\", named lines: {}", chip.name, chip.label,
                                      fmt::join(chip.lines, " ")));
    else
      report.Note("GPIO", fmt::format("{} cannot be opened", chip.name), chip.problem);
  }
} catch (const DeviceError& error) {
  report.Note("GPIO", error.what(), "use the page's button or `plumb press`");
}

void CheckFolder(DoctorReport& report, const char* what, const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    report.Note(what, fmt::format("{} does not exist", folder.string()),
                "the installation makes it (systemd-tmpfiles --create)");
    return;
  }
  const bool writable = ::access(folder.c_str(), W_OK) == 0;
  const auto free_gb = static_cast<double>(fs::space(folder, error).available) / 1e9;
  if (!writable) {
    report.Note(what, fmt::format("{} is not writable for this user", folder.string()),
                "the service's own user writes there; for tests give another");
  } else if (free_gb < 2.0) {
    report.Bad(what, fmt::format("{}: {:.1f} GB free", folder.string(), free_gb),
               "free space: a scan needs up to 1 GB while it runs", kInternalError);
  } else {
    report.Good(what, fmt::format("{}: {:.0f} GB free", folder.string(), free_gb));
  }
}

void CheckDaemon(DoctorReport& report, const fs::path& control) {
  try {
    ::close(ConnectUnix(control));
    report.Good("plumbd",
                fmt::format("answers at {}; while it runs no other program can use the sensor",
                            control.string()));
  } catch (const std::exception& error) {
    report.Note("plumbd", error.what(),
                "start it with systemctl start plumbd, or name its socket with --control");
  }
}

}  // namespace

Command AddDoctor(CLI::App& app) {
  struct Options {
    std::optional<fs::path> config;
    bool json = false;
    double burn_in_min = 0.0;
    std::optional<fs::path> burn_in_folder;
  };
  auto options = std::make_shared<Options>();
  app.add_option("--config", options->config,
                 fmt::format("Configuration of the appliance; default {}", kDefaultConfig))
      ->type_name("FILE");
  app.add_flag("--json", options->json, "Print JSON on the standard output");
  app.add_option("--burn-in", options->burn_in_min,
                 "Then run a load test of this duration: repeated scans of a simulated body, "
                 "memory and disk; every round must give the same bits")
      ->check(CLI::Range(0.01, 10080.0))
      ->type_name("MINUTES");
  app.add_option("--burn-in-folder", options->burn_in_folder,
                 "Folder on the disk to be tested; default: the state folder")
      ->type_name("DIR");
  return [options](const CommandContext& context) {
    DoctorReport report;
    const Config config = CheckConfig(report, options->config);
    CheckSensor(report, config);
    CheckGpio(report);
    CheckFolder(report, "state", config.appliance.state);
    CheckDaemon(report, context.control);
    if (options->burn_in_min > 0.0) {
      BurnIn({.minutes = options->burn_in_min,
              .folder = options->burn_in_folder.value_or(config.appliance.state),
              .control = context.control},
             context.stop, report);
    }
    PrintOut(options->json ? report.Json().dump(2, ' ', false,
                                                nlohmann::ordered_json::error_handler_t::replace) +
                                 "\n"
                           : report.Text());
    return report.exit_code();
  };
}

}  // namespace plumb
