// SPDX-License-Identifier: Apache-2.0
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
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/unit/burn_in.hpp"
#include "daemon/cli/unit/doctor_report.hpp"
#include "daemon/cli/unit/doctor_sensor.hpp"
#include "daemon/config/config.hpp"
#include "drivers/files/unix_socket.hpp"
#include "drivers/gpio/gpio.hpp"
#include "words/doctor.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

Config CheckConfig(DoctorReport& report, const std::optional<fs::path>& wanted) {
  const fs::path file = wanted.value_or(kDefaultConfig);
  std::error_code error;
  if (!wanted && !fs::exists(file, error)) {
    report.Note(say::doctor::Configuration(), say::doctor::NoConfiguration(file.string()),
                say::doctor::WriteConfiguration());
    return {};
  }
  try {
    Config config = ReadConfig(file, ConfigUse::kAppliance);
    report.Good(say::doctor::Configuration(), say::doctor::File(file.string()));
    return config;
  } catch (const DataError& problem) {
    report.Bad(say::doctor::Configuration(), problem.message(), say::doctor::CorrectConfiguration(),
               kBadInput);
    return {};
  }
}

void CheckGpio(DoctorReport& report) try {
  const std::vector<GpioChipDescription> chips = ListGpioChips();
  if (chips.empty())
    report.Note(say::doctor::Gpio(), say::doctor::NoChip(), say::doctor::UsePageOrBoard());
  for (const GpioChipDescription& chip : chips) {
    if (chip.problem.empty())
      report.Good(
          say::doctor::Gpio(),
          say::doctor::Chip(chip.name, chip.label, fmt::format("{}", fmt::join(chip.lines, " "))));
    else
      report.Note(say::doctor::Gpio(), say::doctor::ChipClosed(chip.name), chip.problem);
  }
} catch (const DeviceError& error) {
  report.Note(say::doctor::Gpio(), error.message(), say::doctor::UsePage());
}

void CheckFolder(DoctorReport& report, const Message& what, const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    report.Note(what, say::doctor::NoFolder(folder.string()), say::doctor::InstallMakesIt());
    return;
  }
  const bool writable = ::access(folder.c_str(), W_OK) == 0;
  const auto free_gb = static_cast<double>(fs::space(folder, error).available) / 1e9;
  if (!writable) {
    report.Note(what, say::doctor::NotWritable(folder.string()), say::doctor::ServiceWrites());
  } else if (free_gb < 2.0) {
    report.Bad(what, say::doctor::LittleSpace(folder.string(), free_gb), say::doctor::FreeSpace(),
               kInternalError);
  } else {
    report.Good(what, say::doctor::Space(folder.string(), free_gb));
  }
}

void CheckDaemon(DoctorReport& report, const fs::path& control) {
  try {
    ::close(ConnectUnix(control));
    report.Good(say::doctor::Plumbd(), say::doctor::PlumbdAnswers(control.string()));
  } catch (const std::exception& error) {
    report.Note(say::doctor::Plumbd(), MessageOf(error), say::doctor::StartPlumbd());
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
    CheckFolder(report, say::doctor::State(), config.appliance.state);
    CheckDaemon(report, context.control);
    if (options->burn_in_min > 0.0) {
      BurnIn({.minutes = options->burn_in_min,
              .folder = options->burn_in_folder.value_or(config.appliance.state),
              .control = context.control},
             context, report);
    }
    PrintOut(options->json ? report.Json().dump(2, ' ', false,
                                                nlohmann::ordered_json::error_handler_t::replace) +
                                 "\n"
                           : report.Text(context.language));
    return report.exit_code();
  };
}

}  // namespace plumb
