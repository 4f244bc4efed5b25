// The record of all actions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "web/service/service_types.hpp"

namespace plumb::web {

/// Selection of entries.
struct AuditQuery {
  std::int64_t before = 0;  ///< Only entries older than this number; 0: from the newest one.
  int limit = 100;
  std::string actions = {};  ///< Prefix of their actions; empty: all.
  bool views = true;         ///< Include views of patient data.
};

/// The rules of services.hpp hold.
class AuditLog {
 public:
  virtual ~AuditLog() = default;

  /// For logins and other actions that do not change the store. May be written later, in order.
  virtual void Log(const Actor& actor, const std::string& action, const std::string& subject,
                   const std::string& detail) = 0;
  /// Newest first (background).
  [[nodiscard]] virtual std::vector<AuditEntry> Audit(const AuditQuery& query) = 0;
  /// The log as it is stored, with the digests by which it can be checked: one JSON object a line,
  /// oldest first (background).
  [[nodiscard]] virtual std::string ExportAudit() = 0;
};

}  // namespace plumb::web
