// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/log.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include <fmt/format.h>

#include "daemon/loop/journal_sender.hpp"

namespace plumb {
namespace {

/// True if stderr is the very stream that systemd connected to the journal.
bool StderrIsJournal() {
  const char* stream = std::getenv("JOURNAL_STREAM");
  struct stat status {};
  unsigned long device = 0, inode = 0;
  return stream != nullptr && std::sscanf(stream, "%lu:%lu", &device, &inode) == 2 &&
         ::fstat(STDERR_FILENO, &status) == 0 && status.st_dev == device && status.st_ino == inode;
}

const char* Name(LogLevel level) {
  switch (level) {
    case LogLevel::kError:
      return "error";
    case LogLevel::kWarning:
      return "warning";
    case LogLevel::kNotice:
      return "notice";
    case LogLevel::kInfo:
      return "info";
    case LogLevel::kDebug:
      break;
  }
  return "debug";
}

void ToJournal(LogLevel level, std::string_view message, LogFields fields) {
  // Never destroyed: threads may log until the very end.
  static JournalSender& sender = *new JournalSender;
  JournalSender::Fields all = {{"PRIORITY", fmt::format("{}", static_cast<int>(level))},
                               {"SYSLOG_IDENTIFIER", "plumbd"}};
  for (const auto& [name, value] : fields)
    all.emplace_back(fmt::format("PLUMB_{}", name), fmt::format("{}", value));
  sender.Send(message, all);
}

void ToStderr(LogLevel level, std::string_view message, LogFields fields) {
  std::string line = fmt::format("plumbd: {}: {}", Name(level), message);
  for (const auto& [name, value] : fields) line += fmt::format(" {}={}", name, value);
  line += '\n';
  (void)std::fwrite(line.data(), 1, line.size(), stderr);
}

}  // namespace

void Log(LogLevel level, std::string_view message, LogFields fields) noexcept {
  static const bool is_journal = StderrIsJournal();
  try {
    is_journal ? ToJournal(level, message, fields) : ToStderr(level, message, fields);
  } catch (const std::exception&) {  // out of memory: at most a line is lost
  }
}

}  // namespace plumb
