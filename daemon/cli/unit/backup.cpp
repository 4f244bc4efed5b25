// SPDX-License-Identifier: Apache-2.0
// `plumb backup` and `plumb restore`: copies of the state folder.
#include <unistd.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>

#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/archive/backup.hpp"
#include "daemon/archive/rehearsal.hpp"
#include "daemon/cli/ask_plumbd.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/unit/backup_keys.hpp"
#include "daemon/config/config.hpp"
#include "daemon/database/database.hpp"
#include "drivers/files/unix_socket.hpp"
#include "words/backup.hpp"
#include "words/cli.hpp"
#include "words/upkeep.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct BackupArguments {
  fs::path folder;
  RecipientOptions recipients;
  IdentityOptions keys;
  bool verify_only = false, rehearse = false;
  std::optional<fs::path> state;
};

/// The configuration counts where no state folder is named.
ApplianceConfig ConfigOf(const BackupArguments& options) {
  ApplianceConfig config;
  std::error_code ignored;
  if (options.state) {
    config.state = fs::absolute(*options.state);
  } else if (fs::exists(kDefaultConfig, ignored)) {
    config = ReadConfig(kDefaultConfig).appliance;
  }
  return config;
}

bool IsPlumbdThere(const fs::path& control) {
  try {
    ::close(ConnectUnix(control));
    return true;
  } catch (const DeviceError&) {
    return false;
  }
}

void PrintReport(Message (*done)(std::string_view, std::int64_t, std::int64_t, double),
                 const fs::path& folder, const BackupReport& report,
                 const CommandContext& context) {
  std::string text = context.Said(done(folder.string(), static_cast<std::int64_t>(report.scans),
                                       static_cast<std::int64_t>(report.files),
                                       static_cast<double>(report.bytes) / 1e6)) +
                     "\n";
  if (!report.unrehearsed.empty())
    text += "  " + context.Said(say::upkeep::BackupNotRehearsed(report.unrehearsed)) + "\n";
  for (const Message& problem : report.problems) text += "  " + context.Said(problem) + "\n";
  PrintOut(text);
}

BackupReport AskForBackup(const fs::path& folder, const AgeRecipients& recipients,
                          const CommandContext& context) {
  const nlohmann::ordered_json answer = AskPlumbd(context.control,
                                                  {.kind = ControlRequest::Kind::kBackup,
                                                   .action = {},
                                                   .argument = {},
                                                   .folder = folder.string(),
                                                   .recipients = recipients},
                                                  context.stop, std::nullopt);
  if (!answer.value("ok", false)) throw IoError(WhyRefused(answer));
  return {.scans = answer.value("scans", std::size_t{0}),
          .files = answer.value("files", std::size_t{0}),
          .bytes = answer.value("bytes", std::uint64_t{0}),
          .problems = AllSaidIn(answer, "problem"),
          .target = answer.value("target", folder.string())};
}

int Verify(BackupArguments& options, const CommandContext& context) {
  const fs::path backup = fs::absolute(options.folder);
  const BackupReport report = VerifyBackup(backup, context.stop, options.keys.Read());
  PrintOut(context.Said(say::cli::Verified(backup.string(), static_cast<std::int64_t>(report.scans),
                                           static_cast<std::int64_t>(report.files))) +
           "\n");
  return kDone;
}

/// A running plumbd makes the backup. For a named state folder, or without plumbd, this program
/// does.
int Backup(BackupArguments& options, const CommandContext& context) {
  if (options.verify_only) return Verify(options, context);
  const fs::path folder = fs::absolute(options.folder);
  AgeRecipients recipients = options.recipients.Read();
  BackupReport report;
  if (!options.state && IsPlumbdThere(context.control)) {
    report = AskForBackup(folder, recipients, context);
  } else {
    const ApplianceConfig config = ConfigOf(options);
    if (recipients.empty()) recipients = config.backup_recipients;
    if (recipients.empty() && !config.backup_key_file.empty())
      throw DataError(say::backup::NeedsRecipients(config.backup_key_file.string()));
    try {
      report = BackUpStopped(config.state, folder, context.stop, recipients);
    } catch (const DatabaseBusy& error) {
      throw IoError(say::cli::StateInUse(error.message()));
    }
  }
  PrintReport(say::cli::BackedUp, report.target, report, context);
  return report.problems.empty() ? kDone : kBadInput;
}

int Restore(BackupArguments& options, const CommandContext& context) {
  const fs::path backup = fs::absolute(options.folder);
  if (options.verify_only) return Verify(options, context);
  if (options.rehearse) {
    RehearseRestore(STDIN_FILENO, *options.state, context.stop);
    return kDone;
  }
  const BackupKeys keys = options.keys.Read();
  const fs::path state = ConfigOf(options).state;
  PrintReport(say::cli::Restored, state, RestoreBackup(backup, state, context.stop, keys), context);
  return kDone;
}

}  // namespace

Command AddBackup(CLI::App& app) {
  auto options = std::make_shared<BackupArguments>();
  app.add_option("folder", options->folder,
                 "Folder of the backup, or one file if its name ends in .tar; an older backup "
                 "there is replaced. An encrypted one is a file, and .tar.age is added to its name")
      ->required()
      ->type_name("FOLDER|FILE.tar");
  app.add_option(
         "--state", options->state,
         "State folder that no plumbd is using; without it a running plumbd makes the backup")
      ->type_name("DIR");
  options->recipients.AddTo(app);
  auto* const verify = app.add_flag(
      "--verify", options->verify_only,
      "Open the backup that is there, verify every file of it and its database, and make none");
  options->keys.AddTo(app);
  for (const char* name : {"--identity", "--key-file"}) app.get_option(name)->needs(verify);
  for (const char* name : {"--state", "--recipient", "--recipients-file"})
    verify->excludes(app.get_option(name));
  return [options](const CommandContext& context) { return Backup(*options, context); };
}

Command AddRestore(CLI::App& app) {
  auto options = std::make_shared<BackupArguments>();
  app.add_option("folder", options->folder, "The backup")->required()->type_name("FOLDER|FILE.tar");
  app.add_option("--state", options->state,
                 "State folder, missing or empty; default: the one of the configuration")
      ->type_name("DIR");
  options->keys.AddTo(app);
  app.add_flag("--verify", options->verify_only,
               "Verify every file of the backup, and restore nothing");
  app.add_flag(
         "--rehearse", options->rehearse,
         "Read an archive from the standard input (folder: -), unpack it into an empty folder "
         "and open it as plumbd does at a start; plumbd does so with each encrypted backup "
         "before it is encrypted")
      ->needs("--state");
  return [options](const CommandContext& context) { return Restore(*options, context); };
}

}  // namespace plumb
