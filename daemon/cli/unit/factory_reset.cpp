// SPDX-License-Identifier: Apache-2.0
// `plumb factory-reset`: for an engineer with a shell on a unit on whose page nobody can log in any
// more.
#include "daemon/archive/factory_reset.hpp"

#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct FactoryResetArguments {
  fs::path state = "/var/lib/plumb";
  bool keep_records = false, wipe = false, yes = false;
};

int Reset(const FactoryResetArguments& options, const CommandContext& context) {
  if (options.keep_records == options.wipe) throw InvalidRequest(say::cli::KeepOrWipe());
  if (!fs::is_directory(options.state))
    throw DataError(say::cli::NoStateFolder(options.state.string()));
  const Message what = options.wipe ? say::cli::Wiped() : say::cli::AccountsRemoved();
  if (!options.yes) throw InvalidRequest(say::cli::ConfirmReset(what, options.state.string()));
  RequestFactoryReset(options.state,
                      options.wipe ? FactoryReset::kWipe : FactoryReset::kKeepRecords,
                      {.user = "command line", .address = {}});
  PrintOut(context.Said(say::cli::ResetNext(what)) + "\n");
  return kDone;
}

}  // namespace

Command AddFactoryReset(CLI::App& app) {
  auto options = std::make_shared<FactoryResetArguments>();
  app.add_flag("--keep-records", options->keep_records,
               "Remove accounts, paired displays, settings, configuration and keys of the page; "
               "keep patients, scans and the log");
  app.add_flag("--wipe", options->wipe, "Remove everything that is stored");
  app.add_option("--state", options->state, "State folder of plumbd")
      ->type_name("DIR")
      ->capture_default_str();
  app.add_flag("--yes", options->yes, "Confirm the reset");
  return [options](const CommandContext& context) { return Reset(*options, context); };
}

}  // namespace plumb
