#include "daemon/records/scan_digests.hpp"

#include "daemon/records/audit_store.hpp"
#include "daemon/records/stored_values.hpp"

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
                    const std::string& now) {
  if (before == now) return;
  database.Run("UPDATE scans SET unavailable = ? WHERE id = ?", now, scan);
  if (before.empty()) {
    AppendAuditEntry(database, kSelf, "scan.unavailable", ScanId(scan),
                     now + "; nothing was deleted");
  } else if (now.empty()) {
    AppendAuditEntry(database, kSelf, "scan.available", ScanId(scan), "its files are there again");
  }
}

}  // namespace plumb
