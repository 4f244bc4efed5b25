// `plumb factory-reset`: for an engineer with a shell on a unit on whose page nobody can log in any
// more.
#include "daemon/records/factory_reset.hpp"

#include <filesystem>
#include <memory>
#include <stdexcept>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct FactoryResetArguments {
  fs::path state = "/var/lib/plumb";
  bool keep_records = false, wipe = false, yes = false;
};

int Reset(const FactoryResetArguments& options) {
  if (options.keep_records == options.wipe)
    throw std::invalid_argument("give one of --keep-records and --wipe");
  if (!fs::is_directory(options.state))
    throw DataError(fmt::format("{} is not a folder: name the state folder of plumbd with --state",
                                options.state.string()));
  const char* what = options.wipe
                         ? "every patient, reference, scan, account and setting, and the log"
                         : "all accounts, paired displays, settings and keys of the page";
  if (!options.yes)
    throw std::invalid_argument(
        fmt::format("this removes {} in {}: confirm with --yes", what, options.state.string()));
  RequestFactoryReset(options.state,
                      options.wipe ? FactoryReset::kWipe : FactoryReset::kKeepRecords,
                      {.user = "command line", .address = {}});
  PrintOut(fmt::format("the next start of plumbd removes {}: systemctl restart plumbd\n", what));
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
  return [options](const CommandContext&) { return Reset(*options); };
}

}  // namespace plumb
