// SPDX-License-Identifier: Apache-2.0
// `plumb`: the command line on recordings, scenes and results.
#include <array>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/notice.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/cli/signals.hpp"
#include "daemon/config/version.hpp"
#include "daemon/loop/crash_report.hpp"
#include "daemon/loop/freed_memory.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

int RunAndReport(const std::string& name, const Command& command, const CommandContext& context) {
  const auto report = [&](const Message& what, ExitCode code) {
    fmt::print(stderr, "plumb {}: {}\n", name, context.Said(what));
    return code;
  };
  try {
    return command(context);
  } catch (const Interrupted& error) {
    return report(say::cli::Interrupted(error.message()), kInterrupted);
  } catch (const DataError& error) {
    return report(error.message(), kBadInput);
  } catch (const DeviceError& error) {
    return report(say::cli::Device(error.message()), kDeviceFailed);
  } catch (const IoError& error) {
    return report(error.message(), kInternalError);
  } catch (const std::invalid_argument& error) {
    return report(MessageOf(error), kUsageError);
  } catch (const std::bad_alloc&) {
    return report(say::cli::OutOfMemory(), kInternalError);
  } catch (const std::exception& error) {
    return report(say::cli::InternalError(MessageOf(error)), kInternalError);
  }
}

/// What holds for all commands.
void DescribeProgram(CLI::App& app, std::filesystem::path& control, std::string& language) {
  app.set_version_flag("--version", fmt::format("plumb {}", Version()),
                       "Print the version and exit");
  app.set_help_flag("-h,--help", "Print this help, or with a command its own, and exit");
  app.require_subcommand(1);
  app.add_option("--control", control,
                 "Control socket of plumbd, for status, press, watch, sim, backup and update")
      ->type_name("SOCK")
      ->capture_default_str();
  app.add_option("--language", language,
                 fmt::format("Language of messages and reports: {}; default: that of LC_ALL, "
                             "LC_MESSAGES or LANG, otherwise English",
                             LanguageCodes()))
      ->check([](const std::string& code) {
        return FindCatalogue(code) != nullptr ? std::string() : UnknownLanguage(code).English();
      })
      ->type_name("CODE");
  app.get_formatter()->column_width(34);
  app.footer(
      fmt::format("\nplumb COMMAND --help explains its options.\n"
                  "Exit codes: 0 done, 1 internal or I/O error, 2 usage, 3 bad input, 4 no answer, "
                  "5 device, 130 interrupted.\n\n{}",
                  kResearchNotice));
}

/// Those of any build; StoreCommands() has the others.
constexpr auto kCommands = std::to_array<CommandEntry>({
    {"simulate",
     "Render recordings with known truth: a mannequin, a room with markers, a hand-held sensor",
     AddSimulate},
    {"reconstruct", "Turn a recording into a scene: trajectory, markers, surface, height map",
     AddReconstruct},
    {"calibrate",
     "Learn a sensor unit's profile from ordinary sweeps, for reconstruct --sensor-profile",
     AddCalibrate},
    {"compare",
     "Compare a current scene with a reference: error map, motion of the body, six couch numbers, "
     "verdict",
     AddCompare},
    {"repeat",
     "Show what sensor and room achieve: sweeps of a thing that did not move, compared with each "
     "other",
     AddRepeat},
    {"monitor",
     "Watch a body with a sensor at rest: six numbers of its motion for each frame, breathing, "
     "advice",
     AddMonitor},
    {"mesh", "Export the surface of a scene as PLY, STL or OBJ", AddMesh},
    {"info", "Describe a recording, a scene, a result or a DICOM file", AddInfo},
    {"import", "Turn a recording of another program into one in Plumb's own layout", AddImport},
    {"import-dicom", "Turn the contours and the isocentre of a planning CT into a reference scene",
     AddImportDicom},
    {"export-dicom", "Write a result, its pictures and the scanned surface as DICOM files",
     AddExportDicom},
    {"send-dicom", "Send DICOM files to an archive or another node (C-STORE)", AddSendDicom},
    {"evaluate",
     "Measure the accuracy on a suite of recordings with truth, and show the paper's table",
     AddEvaluate},
    {"record", "Record from the attached sensor, or from a virtual one", AddRecord},
    {"markers", "Draw printable sheets of markers at true size", AddMarkers},
    {"doctor", "Check what is attached, permitted and configured, with advice", AddDoctor},
    {"status", "Show the status of a running plumbd: state, sensor, scan, last result", AddStatus},
    {"press", "Press the button of a running plumbd", AddPress},
    {"test-message", "Send a test message to those whom [messages] of plumbd names",
     AddTestMessage},
    {"presence", "Show the code by which a log-in proves that it comes from the room", AddPresence},
    {"watch", "Print the events of a running plumbd, one JSON object per line", AddWatch},
    {"sim", "Plug, unplug, stall or advance the virtual sensor of a running plumbd", AddSim},
    {"update", "Install a bundle on the machine of a running plumbd, and restart it", AddUpdate},
});

int Main(int argc, char** argv) {
  const SignalStop signals;
  CLI::App app(
      "Plumb: a hand-held RGB-D sweep becomes a surface, two sweeps become the correction of a "
      "patient's position.",
      "plumb");
  std::filesystem::path control = "/run/plumb/control.sock";
  std::string language;
  DescribeProgram(app, control, language);

  std::vector<std::pair<CLI::App*, Command>> commands;
  const auto add = [&](const CommandEntry& entry) {
    CLI::App* command = app.add_subcommand(entry.name, entry.description);
    command->set_help_flag("-h,--help", "Print this help and exit");
    commands.emplace_back(command, entry.add_options(*command));
  };
  for (const CommandEntry& entry : kCommands) add(entry);
  for (const CommandEntry& entry : StoreCommands()) add(entry);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kUsageError;
  }
  for (const auto& [subcommand, command] : commands) {
    if (subcommand->parsed())
      return RunAndReport(
          subcommand->get_name(), command,
          {.stop = signals.token(),
           .control = control,
           .language = language.empty() ? LanguageOfEnvironment() : *FindCatalogue(language)});
  }
  return kUsageError;
}

}  // namespace

}  // namespace plumb

int main(int argc, char** argv) {
  plumb::KeepFreedMemory();
  plumb::ReportCrashes("plumb", plumb::Version().data());
  try {
    return plumb::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "plumb: internal error: %s\n", error.what());
    return plumb::kInternalError;
  }
}
