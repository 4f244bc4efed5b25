// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/backup_register.hpp"

#include <string>

#include "algo/base/errors.hpp"
#include "daemon/archive/summed_folder.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// Why the backup is not as it was made; empty if it is.
Message WhyNotAsMade(const fs::path& place, const std::string& sha256,
                     const std::stop_token& stop) {
  try {
    if (DigestOfBackup(place, stop) != sha256) return say::backup::NotAsMade(place.string());
    if (fs::is_directory(place)) (void)VerifyBackup(place, stop, {});
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    return MessageOf(error);
  }
  return {};
}

struct Noted {
  std::int64_t id = 0;
  std::string place, sha256;
};

}  // namespace

/// The digest of a file. For a folder that of its list of sums, which has the digest of each file.
std::string DigestOfBackup(const fs::path& place, const std::stop_token& stop) {
  const fs::path file = fs::is_directory(place) ? place / kSumsFile : place;
  return DigestOfFile(file.parent_path(), file.filename().string(), stop).sha256;
}

void NoteBackup(Database& database, const BackupReport& made, const std::string& sha256) {
  const fs::path place = fs::absolute(made.target);
  Transaction transaction(database);
  database.Run("DELETE FROM backups WHERE place = ?", place.string());
  database.Run("INSERT INTO backups (place, sha256, made_at) VALUES (?, ?, ?)", place.string(),
               sha256, StoredNow());
  const std::int64_t id = database.last_id();
  for (const std::string& scan : made.whole_scans)
    database.Run("INSERT INTO backup_scans (backup_id, scan_id) VALUES (?, ?)", id, ParseId(scan));
  transaction.Commit();
}

std::optional<CheckedBackup> CheckNextBackup(StoreDatabase& database, std::chrono::hours at_least,
                                             const std::stop_token& stop) {
  const std::int64_t now = StoredNow();
  // The time of a check that lies in the future came from a wrong clock: check again.
  const std::optional<Noted> next = database.ForRows()->First(
      "SELECT id, place, sha256 FROM backups WHERE checked_at <= ? OR checked_at > ? ORDER BY "
      "checked_at LIMIT 1",
      [](const Statement& row) {
        return Noted{.id = row.Integer(0), .place = row.Text(1), .sha256 = row.Text(2)};
      },
      now - std::chrono::microseconds(at_least).count(), now);
  if (!next) return std::nullopt;
  CheckedBackup checked{.place = next->place,
                        .fault = WhyNotAsMade(next->place, next->sha256, stop)};
  const StoreDatabase::Held writer = database.ForChanges();
  Transaction transaction(*writer);
  writer->Run("UPDATE backups SET checked_at = ?, verified_at = ? WHERE id = ? AND sha256 = ?", now,
              checked.fault.empty() ? now : 0, next->id, next->sha256);
  transaction.Commit();
  return checked;
}

bool IsVerificationDue(Database& database, WallClock::time_point now) {
  // An entry is its sentence in English, behind which its message stands: see DetailIn().
  const std::optional<std::int64_t> since = database.FirstInteger(
      "SELECT since FROM (SELECT ifnull((SELECT max(time) FROM audit WHERE action = "
      "'backup.verify'), (SELECT min(time) FROM audit WHERE action = 'backup.make' AND "
      "instr(detail || char(31), ', encrypted' || char(31)))) AS since) WHERE since IS NOT NULL");
  return since && now - FromStored(*since) > kVerifiedEvery;
}

}  // namespace plumb
