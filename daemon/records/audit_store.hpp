// The audit log: who changed what, and when.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/records/store_database.hpp"
#include "web/service/audit_log.hpp"

namespace plumb {

/// Adds an entry as part of the open transaction. Each entry carries the SHA-256 of the previous
/// entry and itself.
void AppendAuditEntry(Database& database, const web::Actor& actor, const std::string& action,
                      const std::string& subject, const std::string& detail);

/// Thread-safe. @throws IoError and its kinds
class AuditStore {
 public:
  explicit AuditStore(StoreDatabase& database) : database_(database) {}

  void Log(const web::Actor& actor, const std::string& action, const std::string& subject,
           const std::string& detail);
  /// Newest first.
  [[nodiscard]] std::vector<web::AuditEntry> Find(const web::AuditQuery& wanted);
  /// The number of the first entry that does not match the previous one; nothing if the log is as
  /// it was written. Entries from before schema 5 are covered together.
  [[nodiscard]] std::optional<std::int64_t> FirstBroken();

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
