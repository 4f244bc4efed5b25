// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/log.hpp"

#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <vector>

#include <fmt/format.h>

#define SD_JOURNAL_SUPPRESS_LOCATION
#include <systemd/sd-journal.h>

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
  std::vector<std::string> lines = {fmt::format("MESSAGE={}", message),
                                    fmt::format("PRIORITY={}", static_cast<int>(level)),
                                    "SYSLOG_IDENTIFIER=plumbd"};
  for (const auto& [name, value] : fields) lines.push_back(fmt::format("PLUMB_{}={}", name, value));
  std::vector<iovec> parts;
  for (std::string& line : lines) parts.push_back({line.data(), line.size()});
  sd_journal_sendv(parts.data(), static_cast<int>(parts.size()));
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
