// `plumb`: the command line on recordings, scenes and results.
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
#include "daemon/cli/signals.hpp"
#include "daemon/config/version.hpp"
#include "daemon/loop/crash_report.hpp"
#include "daemon/loop/freed_memory.hpp"

namespace plumb {
namespace {

int Report(const std::string& command, const std::string& kind, const char* what, ExitCode code) {
  fmt::print(stderr, "plumb {}: {}{}\n", command, kind, what);
  return code;
}

int RunAndReport(const std::string& name, const Command& command, const CommandContext& context) {
  try {
    return command(context);
  } catch (const Interrupted& error) {
    return Report(name, "interrupted: ", error.what(), kInterrupted);
  } catch (const DataError& error) {
    return Report(name, "", error.what(), kBadInput);
  } catch (const DeviceError& error) {
    return Report(name, "device: ", error.what(), kDeviceFailed);
  } catch (const IoError& error) {
    return Report(name, "", error.what(), kInternalError);
  } catch (const std::invalid_argument& error) {
    return Report(name, "", error.what(), kUsageError);
  } catch (const std::bad_alloc&) {
    return Report(name, "", "out of memory; use a smaller recording or a coarser height map",
                  kInternalError);
  } catch (const std::exception& error) {
    return Report(name, "internal error: ", error.what(), kInternalError);
  }
}

int Main(int argc, char** argv) {
  const SignalStop signals;
  CLI::App app(
      "Plumb: a hand-held RGB-D sweep becomes a surface, two sweeps become the correction of a "
      "patient's position.",
      "plumb");
  app.set_version_flag("--version", fmt::format("plumb {}", Version()),
                       "Print the version and exit");
  app.set_help_flag("-h,--help", "Print this help, or with a command its own, and exit");
  app.require_subcommand(1);
  std::filesystem::path control = "/run/plumb/control.sock";
  app.add_option("--control", control,
                 "Control socket of plumbd, for status, press, watch, sim, backup and update")
      ->type_name("SOCK")
      ->capture_default_str();
  app.get_formatter()->column_width(34);
  app.footer(
      fmt::format("\nplumb COMMAND --help explains its options.\n"
                  "Exit codes: 0 done, 1 internal or I/O error, 2 usage, 3 bad input, 4 no answer, "
                  "5 device, 130 interrupted.\n\n{}",
                  kResearchNotice));

  std::vector<std::pair<CLI::App*, Command>> commands;
  const auto add = [&](const char* name, const char* description,
                       Command (*add_options)(CLI::App&)) {
    CLI::App* command = app.add_subcommand(name, description);
    command->set_help_flag("-h,--help", "Print this help and exit");
    commands.emplace_back(command, add_options(*command));
  };
  add("simulate",
      "Render recordings with known truth: a mannequin, a room with markers, a hand-held sensor",
      AddSimulate);
  add("reconstruct", "Turn a recording into a scene: trajectory, markers, surface, height map",
      AddReconstruct);
  add("calibrate",
      "Learn a sensor unit's profile from ordinary sweeps, for reconstruct --sensor-profile",
      AddCalibrate);
  add("compare",
      "Compare a current scene with a reference: error map, motion of the body, six couch numbers, "
      "verdict",
      AddCompare);
  add("mesh", "Export the surface of a scene as PLY, STL or OBJ", AddMesh);
  add("info", "Describe a recording, a scene or a result", AddInfo);
  add("evaluate",
      "Measure the accuracy on a suite of recordings with truth, and show the paper's table",
      AddEvaluate);
  add("record", "Record from the attached sensor, or from a virtual one", AddRecord);
  add("markers", "Draw printable sheets of markers at true size", AddMarkers);
  add("doctor", "Check what is attached, permitted and configured, with advice", AddDoctor);
  add("status", "Show the status of a running plumbd: state, sensor, scan, last result", AddStatus);
  add("press", "Press the button of a running plumbd", AddPress);
  add("watch", "Print the events of a running plumbd, one JSON object per line", AddWatch);
  add("sim", "Plug, unplug, stall or advance the virtual sensor of a running plumbd", AddSim);
  add("update", "Install a bundle on the machine of a running plumbd, and restart it", AddUpdate);
  for (const CommandEntry& entry : StoreCommands())
    add(entry.name, entry.description, entry.add_options);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kUsageError;
  }
  for (const auto& [subcommand, command] : commands) {
    if (subcommand->parsed())
      return RunAndReport(subcommand->get_name(), command,
                          {.stop = signals.token(), .control = control});
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
