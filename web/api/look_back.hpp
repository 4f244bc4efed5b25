// What the log knows of earlier times: the last log-in of a person, the last backup.
#pragma once

#include <optional>
#include <string>

#include "web/service/audit_log.hpp"

namespace plumb::web {

struct LoginHistory {
  std::optional<AuditEntry> last;  ///< The log-in before this one.
  int failed = 0;                  ///< Wrong passwords for this name since then.
};

/// To be called within BackgroundWork::Later(). Of log-ins the newest 5000 entries are read.
/// @param before  When the present session began.
[[nodiscard]] LoginHistory LoginsBefore(AuditLog& log, const std::string& user,
                                        WallClock::time_point before);
[[nodiscard]] std::optional<AuditEntry> LastBackup(AuditLog& log);

}  // namespace plumb::web
