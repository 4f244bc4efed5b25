#include "daemon/records/scan_digests.hpp"

#include "daemon/records/audit_store.hpp"
#include "daemon/records/stored_values.hpp"

namespace plumb {

using store::ScanId;

std::vector<FileDigest> StoredDigests(Database& database, std::int64_t scan) {
  Statement query = database.Prepare(
      "SELECT path, bytes, sha256 FROM scan_files WHERE scan_id = ? ORDER BY path");
  query.Bind(scan);
  std::vector<FileDigest> files;
  while (query.Step()) {
    files.push_back({.path = query.Text(0),
                     .bytes = static_cast<std::uint64_t>(query.Integer(1)),
                     .sha256 = query.Text(2)});
  }
  return files;
}

void StoreDigests(Database& database, std::int64_t scan, const std::vector<FileDigest>& files) {
  for (const FileDigest& file : files) {
    database
        .Prepare(
            "INSERT OR IGNORE INTO scan_files (scan_id, path, bytes, sha256) VALUES (?, ?, ?, ?)")
        .Bind(scan)
        .Bind(file.path)
        .Bind(static_cast<std::int64_t>(file.bytes))
        .Bind(file.sha256)
        .Run();
  }
}

void SetUnavailable(Database& database, std::int64_t scan, const std::string& before,
                    const std::string& now) {
  if (before == now) return;
  database.Prepare("UPDATE scans SET unavailable = ? WHERE id = ?").Bind(now).Bind(scan).Run();
  if (before.empty()) {
    AppendAuditEntry(database, store::kSelf, "scan.unavailable", ScanId(scan),
                     now + "; nothing was deleted");
  } else if (now.empty()) {
    AppendAuditEntry(database, store::kSelf, "scan.available", ScanId(scan),
                     "its files are there again");
  }
}

}  // namespace plumb
