// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/scan_digests.hpp"

#include "daemon/database/audit_store.hpp"
#include "daemon/database/stored_values.hpp"
#include "words/store.hpp"

namespace plumb {

std::vector<FileDigest> StoredDigests(Database& database, std::int64_t scan) {
  return database.All(
      "SELECT path, bytes, sha256 FROM scan_files WHERE scan_id = ? ORDER BY path",
      [](const Statement& row) {
        return FileDigest{.path = row.Text(0),
                          .bytes = static_cast<std::uint64_t>(row.Integer(1)),
                          .sha256 = row.Text(2)};
      },
      scan);
}

void StoreDigests(Database& database, std::int64_t scan, const std::vector<FileDigest>& files) {
  for (const FileDigest& file : files) {
    database.Run(
        "INSERT OR IGNORE INTO scan_files (scan_id, path, bytes, sha256) VALUES (?, ?, ?, ?)", scan,
        file.path, static_cast<std::int64_t>(file.bytes), file.sha256);
  }
}

void SetUnavailable(Database& database, std::int64_t scan, const std::string& before,
                    const Message& now) {
  const std::string english = now.English();
  if (before == english) return;
  database.Run("UPDATE scans SET unavailable = ?, unavailable_message = ? WHERE id = ?", english,
               MessageColumn(now), scan);
  if (before.empty()) {
    AppendAuditEntry(database, kSelf, "scan.unavailable", ScanId(scan),
                     say::store::LogUnavailable(now));
  } else if (now.empty()) {
    AppendAuditEntry(database, kSelf, "scan.available", ScanId(scan), say::store::LogAvailable());
  }
}

}  // namespace plumb
