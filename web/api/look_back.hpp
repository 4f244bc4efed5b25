// SPDX-License-Identifier: Apache-2.0
// Searches the log for earlier events: the last login of a person, the last backup.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "web/service/account_services.hpp"

namespace plumb::web {

struct LoginHistory {
  std::optional<AuditEntry> last;  ///< The login before this one.
  int failed = 0;                  ///< Wrong passwords for this name since then.
  /// What was changed about the account since then, newest first.
  std::vector<AuditEntry> changes;
};

/// To be called within BackgroundWork::RunInBackground(). Reads the newest 5000 entries of logins.
/// @param before  Beginning of the present session.
[[nodiscard]] LoginHistory LoginsBefore(AuditLog& log, const std::string& user,
                                        WallClock::time_point before);
/// The newest of an action.
[[nodiscard]] std::optional<AuditEntry> LastEntry(AuditLog& log, const std::string& action);

}  // namespace plumb::web
