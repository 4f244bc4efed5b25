// SPDX-License-Identifier: Apache-2.0
// `plumb verify-log`: whether a downloaded audit log is as it was written.
#include <memory>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "daemon/cli/commands.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/database/audit_store.hpp"
#include "drivers/files/file_io.hpp"
#include "words/cli.hpp"

namespace plumb {

Command AddVerifyLog(CLI::App& app) {
  auto file = std::make_shared<std::filesystem::path>();
  app.add_option("file", *file, "The log, as downloaded from the page (plumb_log.jsonl)")
      ->required()
      ->type_name("FILE");
  return [file](const CommandContext& context) {
    constexpr std::size_t kMaxBytes = std::size_t{1} << 30;
    const AuditHead head = CheckAuditExport(ReadTextFile(*file, kMaxBytes));
    PrintOut(fmt::format("{}\n{} {}\n", context.Said(say::cli::LogIntact(head.number)),
                         LeftAligned(context.Said(say::cli::Chain()), 8),
                         head.chain.empty() ? context.Said(say::cli::NoChain()) : head.chain));
    return static_cast<int>(kDone);
  };
}

}  // namespace plumb
