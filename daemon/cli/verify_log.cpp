// `plumb verify-log`: whether a downloaded audit log is as it was written.
#include <memory>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "daemon/cli/commands.hpp"
#include "daemon/records/audit_store.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {

Command AddVerifyLog(CLI::App& app) {
  auto file = std::make_shared<std::filesystem::path>();
  app.add_option("file", *file, "The log, as downloaded from the page (plumb_log.jsonl)")
      ->required()
      ->type_name("FILE");
  return [file](const CommandContext&) {
    constexpr std::size_t kMaxBytes = std::size_t{1} << 30;
    const AuditHead head = CheckAuditExport(ReadTextFile(*file, kMaxBytes));
    PrintOut(fmt::format("the log is as it was written, up to entry {}\nchain    {}\n", head.number,
                         head.chain.empty() ? "none" : head.chain));
    return static_cast<int>(kDone);
  };
}

}  // namespace plumb
