// Who did what, and when.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "web/service/service_types.hpp"

namespace plumb::web {

/// Which entries of the log are asked for.
struct AuditQuery {
  std::int64_t before = 0;  ///< Older than this number; 0: from the newest one on.
  int limit = 100;
  std::string actions = {};  ///< How their actions begin; empty: all.
  bool views = true;         ///< Also who saw what.
};

/// The rules of services.hpp hold.
class AuditLog {
 public:
  virtual ~AuditLog() = default;

  /// Logins and what else is no change of the store. May be written later, in order.
  virtual void Log(const Actor& actor, const std::string& action, const std::string& subject,
                   const std::string& detail) = 0;
  /// Newest first (aside).
  [[nodiscard]] virtual std::vector<AuditEntry> Audit(const AuditQuery& query) = 0;
};

}  // namespace plumb::web
