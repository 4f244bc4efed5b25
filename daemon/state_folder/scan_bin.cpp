// SPDX-License-Identifier: Apache-2.0
#include "daemon/state_folder/scan_bin.hpp"

#include <filesystem>
#include <optional>
#include <system_error>

#include "daemon/database/stored_values.hpp"

namespace plumb {

namespace fs = std::filesystem;

void NoteInBin(Database& database, std::int64_t scan, std::int64_t patient) {
  database.Run("INSERT OR REPLACE INTO bin (scan_id, patient_id, binned_at) VALUES (?, ?, ?)", scan,
               patient, StoredNow());
}

void MoveToBin(const ScanFolders& folders, const std::string& scan_id) {
  const fs::path from = folders.Scan(scan_id), to = folders.Bin(scan_id);
  std::error_code error;
  if (!fs::exists(from, error)) return;
  fs::create_directories(to.parent_path(), error);
  fs::remove_all(to, error);
  fs::rename(from, to, error);
  if (error) fs::remove_all(from, error);
}

void NoteStrayInBin(Database& database, const ScanFolders& folders) {
  std::error_code error;
  fs::directory_iterator entry(folders.scans() / ScanFolders::kBin, error);
  for (const fs::directory_iterator end; !error && entry != end; entry.increment(error)) {
    const std::optional<std::int64_t> scan = ParseId(entry->path().filename().string());
    if (!scan || database.Has("SELECT 1 FROM bin WHERE scan_id = ?", *scan)) continue;
    Transaction transaction(database);
    NoteInBin(database, *scan, 0);
    transaction.Commit();
  }
}

std::vector<std::string> TakeFromBin(Database& database, std::chrono::hours at_least) {
  const std::int64_t now = StoredNow();
  database.Run("UPDATE bin SET binned_at = ?1 WHERE binned_at > ?1", now);
  return database.All(
      "DELETE FROM bin WHERE binned_at <= ? RETURNING scan_id",
      [](const Statement& row) { return ScanId(row.Integer(0)); },
      now - std::chrono::microseconds(at_least).count());
}

std::vector<std::string> TakeFromBin(Database& database, std::int64_t patient) {
  return database.All(
      "DELETE FROM bin WHERE patient_id = ? RETURNING scan_id",
      [](const Statement& row) { return ScanId(row.Integer(0)); }, patient);
}

}  // namespace plumb
