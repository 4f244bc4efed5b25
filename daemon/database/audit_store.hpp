// SPDX-License-Identifier: Apache-2.0
// The audit log: who changed what, and when.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/database/audit_chain.hpp"
#include "daemon/database/store_database.hpp"
#include "web/model/audit.hpp"

namespace plumb {

/// The newest entry of the log. Its digest covers all earlier entries, so anyone who has kept a
/// copy of it can check later that none of them has been changed.
struct AuditHead {
  std::int64_t number = 0;  ///< 0: there is no entry.
  std::string chain;
};

/// Checks what AuditStore::Export() wrote, each entry against the one before it. The first line of
/// an export that does not begin with entry 1 cannot be checked.
/// @throws DataError naming the first entry that is not as it was written
[[nodiscard]] AuditHead CheckAuditExport(std::string_view lines);

/// Thread-safe. @throws IoError and its kinds
class AuditStore {
 public:
  explicit AuditStore(StoreDatabase& database) : database_(database) {}

  void Log(const Actor& actor, const std::string& action, const std::string& subject,
           const Message& detail);
  /// The same with a text from outside, such as a person's reason.
  void Log(const Actor& actor, const std::string& action, const std::string& subject,
           const std::string& verbatim);
  /// Newest first.
  [[nodiscard]] std::vector<AuditEntry> Find(const AuditQuery& wanted);
  /// The newest kMaxExported entries, oldest first: one JSON object per line, with all fields that
  /// the chain covers and its digests. A field that is not UTF-8 is exported with U+FFFD, and its
  /// bytes as numbers in FIELD_bytes.
  [[nodiscard]] std::string Export();
  static constexpr int kMaxExported = 200'000;
  [[nodiscard]] AuditHead Head();
  /// The number of the first entry that does not match the previous one; nothing if the log is as
  /// it was written. Entries of 0.1.0, which had no chain, are covered together.
  [[nodiscard]] std::optional<std::int64_t> FirstBroken();

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
