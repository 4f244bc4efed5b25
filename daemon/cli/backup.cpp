// `plumb backup` and `plumb restore`: copies of the state folder.
#include <unistd.h>

#include <memory>
#include <optional>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/ask_plumbd.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/config/config.hpp"
#include "daemon/control/unix_socket.hpp"
#include "daemon/records/backup.hpp"
#include "daemon/records/database.hpp"
#include "daemon/records/file_cipher.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct BackupArguments {
  fs::path folder;
  std::optional<fs::path> key_file;
  std::optional<fs::path> state;
};

fs::path StateFolder(const BackupArguments& options) {
  if (options.state) return fs::absolute(*options.state);
  std::error_code ignored;
  return fs::exists(kDefaultConfig, ignored) ? ReadConfig(kDefaultConfig).appliance.state
                                             : ApplianceConfig{}.state;
}

bool IsPlumbdThere(const fs::path& control) {
  try {
    ::close(ConnectUnix(control));
    return true;
  } catch (const DeviceError&) {
    return false;
  }
}

void PrintReport(const char* done, const fs::path& folder, const BackupReport& report) {
  std::string text =
      fmt::format("{} {}: {} scans, {} files, {:.1f} MB\n", done, folder.string(), report.scans,
                  report.files, static_cast<double>(report.bytes) / 1e6);
  for (const std::string& problem : report.problems) text += "  " + problem + "\n";
  PrintOut(text);
}

std::unique_ptr<BackupSecret> SecretOf(const BackupArguments& options) {
  return options.key_file ? std::make_unique<BackupSecret>(*options.key_file) : nullptr;
}

void AddKeyFile(CLI::App& app, BackupArguments& options, const char* what) {
  app.add_option("--key-file", options.key_file, what)->type_name("FILE");
}

/// plumbd reads the key file itself, so that no key is sent through the socket.
BackupReport AskForBackup(const fs::path& folder, const BackupArguments& options,
                          const CommandContext& context) {
  const nlohmann::json answer = AskPlumbd(
      context.control,
      {.kind = ControlRequest::Kind::kBackup,
       .action = {},
       .argument = {},
       .folder = folder.string(),
       .key_file = options.key_file ? fs::absolute(*options.key_file).string() : std::string()},
      context.stop, std::nullopt);
  if (!answer.value("ok", false)) throw IoError(answer.value("error", "refused without a reason"));
  return {.scans = answer.value("scans", std::size_t{0}),
          .files = answer.value("files", std::size_t{0}),
          .bytes = answer.value("bytes", std::uint64_t{0}),
          .problems = answer.value("problems", std::vector<std::string>())};
}

/// A running plumbd makes the backup. For a named state folder, or without plumbd, this program
/// does.
int Backup(const BackupArguments& options, const CommandContext& context) {
  const fs::path folder = fs::absolute(options.folder);
  BackupReport report;
  if (!options.state && IsPlumbdThere(context.control)) {
    report = AskForBackup(folder, options, context);
  } else {
    try {
      report = BackUpStopped(StateFolder(options), folder, context.stop, SecretOf(options).get());
    } catch (const DatabaseBusy& error) {
      throw IoError(
          fmt::format("{}. A running plumbd makes the backup itself: leave out --state, "
                      "and name its socket with --control",
                      error.what()));
    }
  }
  PrintReport("backed up to", folder, report);
  return report.problems.empty() ? kDone : kBadInput;
}

int Restore(const BackupArguments& options, const CommandContext& context) {
  const fs::path state = StateFolder(options);
  PrintReport(
      "restored into", state,
      RestoreBackup(fs::absolute(options.folder), state, context.stop, SecretOf(options).get()));
  return kDone;
}

}  // namespace

Command AddBackup(CLI::App& app) {
  auto options = std::make_shared<BackupArguments>();
  app.add_option("folder", options->folder,
                 "Folder of the backup, or one file if its name ends in .tar; an older backup "
                 "there is replaced")
      ->required()
      ->type_name("FOLDER|FILE.tar");
  app.add_option(
         "--state", options->state,
         "State folder that no plumbd is using; without it a running plumbd makes the backup")
      ->type_name("DIR");
  AddKeyFile(app, *options,
             "Encrypt with the key in this file: one line, a passphrase or a random key. A running "
             "plumbd must be able to read it");
  return [options](const CommandContext& context) { return Backup(*options, context); };
}

Command AddRestore(CLI::App& app) {
  auto options = std::make_shared<BackupArguments>();
  app.add_option("folder", options->folder, "The backup")->required()->type_name("FOLDER|FILE.tar");
  app.add_option("--state", options->state,
                 "State folder, missing or empty; default: the one of the configuration")
      ->type_name("DIR");
  AddKeyFile(app, *options, "File with the key of an encrypted backup");
  return [options](const CommandContext& context) { return Restore(*options, context); };
}

}  // namespace plumb
