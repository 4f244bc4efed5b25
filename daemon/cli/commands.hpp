// SPDX-License-Identifier: Apache-2.0
// The commands of `plumb`: each adds its own options to the command line and returns how to run it.
#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <stop_token>
#include <string>

#include "algo/base/message.hpp"

namespace CLI {
class App;
}

namespace plumb {

/// Documented exit codes.
enum ExitCode : int {
  kDone = 0,
  kInternalError = 1,
  kUsageError = 2,
  kBadInput = 3,
  kNoAnswer = 4,
  kDeviceFailed = 5,
  kInterrupted = 130,
};

/// Passed to every command when it runs.
struct CommandContext {
  std::stop_token stop;           ///< Ctrl-C or SIGTERM.
  std::filesystem::path control;  ///< Control socket of plumbd.
  const Catalogue& language;      ///< Of what is printed for people.

  [[nodiscard]] std::string Said(const Message& message) const { return Text(message, language); }
};

/// Runs the command. Its return value is the exit code; exceptions are converted to the other codes
/// (see plumb_main.cpp).
using Command = std::function<int(const CommandContext&)>;

/// Adds the subcommand to `app` and returns how to run it once the line is parsed.
[[nodiscard]] Command AddSimulate(CLI::App& app);
[[nodiscard]] Command AddReconstruct(CLI::App& app);
[[nodiscard]] Command AddCalibrate(CLI::App& app);
[[nodiscard]] Command AddCompare(CLI::App& app);
[[nodiscard]] Command AddRepeat(CLI::App& app);
[[nodiscard]] Command AddMonitor(CLI::App& app);
[[nodiscard]] Command AddMesh(CLI::App& app);
[[nodiscard]] Command AddInfo(CLI::App& app);
[[nodiscard]] Command AddImport(CLI::App& app);
[[nodiscard]] Command AddImportDicom(CLI::App& app);
[[nodiscard]] Command AddExportDicom(CLI::App& app);
[[nodiscard]] Command AddSendDicom(CLI::App& app);
[[nodiscard]] Command AddEvaluate(CLI::App& app);
[[nodiscard]] Command AddRecord(CLI::App& app);
[[nodiscard]] Command AddMarkers(CLI::App& app);
[[nodiscard]] Command AddDoctor(CLI::App& app);
[[nodiscard]] Command AddStatus(CLI::App& app);
[[nodiscard]] Command AddPress(CLI::App& app);
[[nodiscard]] Command AddPresence(CLI::App& app);
[[nodiscard]] Command AddTestMessage(CLI::App& app);
[[nodiscard]] Command AddWatch(CLI::App& app);
[[nodiscard]] Command AddSim(CLI::App& app);
[[nodiscard]] Command AddUpdate(CLI::App& app);
[[nodiscard]] Command AddBackup(CLI::App& app);
[[nodiscard]] Command AddRestore(CLI::App& app);
[[nodiscard]] Command AddAuthority(CLI::App& app);
[[nodiscard]] Command AddVerifyLog(CLI::App& app);
[[nodiscard]] Command AddExportPatient(CLI::App& app);
[[nodiscard]] Command AddImportPatient(CLI::App& app);
[[nodiscard]] Command AddFactoryReset(CLI::App& app);

/// A subcommand: its name, what its help says first, and one of the functions above.
struct CommandEntry {
  const char* name;
  const char* description;
  Command (*add_options)(CLI::App&);
};
/// Those that work on the stored data of plumbd; none in a build without the appliance.
[[nodiscard]] std::span<const CommandEntry> StoreCommands();

/// Writes to stdout.
/// @throws IoError if stdout cannot be written (closed pipe, full disk).
void PrintOut(const std::string& text);

}  // namespace plumb
