// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/store_retention.hpp"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "daemon/database/store_refusal.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/state_folder/old_copies.hpp"
#include "daemon/state_folder/scan_bin.hpp"
#include "words/backup.hpp"
#include "words/store.hpp"

namespace plumb {

namespace fs = std::filesystem;

namespace {

std::uint64_t BytesOf(const fs::path& folder, const std::stop_token& stop) {
  std::uint64_t bytes = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end;
       !error && entry != end && !stop.stop_requested(); entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored)) bytes += entry->file_size(ignored);
  }
  return bytes;
}

/// So that a start can distinguish removed scans from unknown ones.
void NoteRemoved(StoreChange& change, const std::string& scan_id) {
  change->Run("INSERT OR IGNORE INTO removed_scans (id) VALUES (?)", ParseId(scan_id));
}

std::string ReadScanId(const Statement& row) { return ScanId(row.Integer(0)); }

}  // namespace

std::unique_lock<std::mutex> RemovalGate::LockRemovals() {
  std::unique_lock lock(mutex_);
  if (backing_up_) throw StoreRefusal(ChangeResult::kConflict, say::store::RemovalDuringBackup());
  return lock;
}

RemovalGate::Backup::Backup(RemovalGate& gate) : gate_(gate) {
  const std::lock_guard lock(gate_.mutex_);  // a removal in progress ends first
  if (gate_.backing_up_.exchange(true))
    throw StoreRefusal(ChangeResult::kConflict, say::backup::Running());
}

void StoreRemoval::RemoveFiles(const std::string& scan_id) {
  std::error_code ignored;  // remaining files are removed at the next start
  fs::remove_all(folders_.Scan(scan_id), ignored);
  fs::remove_all(folders_.Bin(scan_id), ignored);
  fs::remove_all(folders_.Staging(scan_id), ignored);
  for (const fs::path& folder : folders_.SetAsideAs(scan_id + ScanFolders::kInterruptedSuffix))
    fs::remove_all(folder, ignored);
}

/// Wipes the old copies first: if one of them cannot be searched, nothing has been wiped yet, and
/// the refusal says so.
void StoreRemoval::WipePatient(const Actor& actor, const std::string& id) {
  const std::int64_t number = RequireId(id, "patient");
  std::vector<std::string> scans;
  const std::unique_lock removals = gate_.LockRemovals();
  const std::optional<std::string> code =
      database_.ForChanges()->FirstText("SELECT code FROM patients WHERE id = ?", number);
  if (!code) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoPatient());
  if (database_.ForChanges()->Has("SELECT 1 FROM scans WHERE patient_id = ? AND id = ?", number,
                                  scans_.running()))
    throw StoreRefusal(ChangeResult::kConflict, say::store::PatientIsScanned());
  for (const fs::path& copy : OldCopies(folders_.state())) WipeFromCopy(copy, *code);
  {
    StoreChange change(database_);
    scans = change->All("SELECT id FROM scans WHERE patient_id = ?", ReadScanId, number);
    if (change->Has("SELECT 1 FROM scans WHERE patient_id = ? AND id = ?", number,
                    scans_.running()))
      throw StoreRefusal(ChangeResult::kConflict, say::store::PatientIsScanned());
    change->Run("UPDATE patients SET wiping = 1 WHERE id = ?", number);
    if (change->num_changed() == 0)
      throw StoreRefusal(ChangeResult::kNotFound, say::store::NoPatient());
    for (const std::string& scan : scans) NoteRemoved(change, scan);
    change->Run("DELETE FROM refs WHERE patient_id = ?", number);
    change->Run("DELETE FROM patients WHERE id = ?", number);
    change.Log(actor, "patient.wipe", id, say::store::LogScans(scans.size()));
    for (std::string& scan : TakeFromBin(*change, number)) scans.push_back(std::move(scan));
    change.Commit();
  }
  for (const std::string& scan : scans)
    RemoveFiles(scan);  // remaining files after a crash are removed at the next start
  std::error_code ignored;
  fs::remove(folders_.state() / "imports" / (std::to_string(number) + ".json"), ignored);
  // The write-ahead log must not keep the wiped data either.
  database_.ForChanges()->Run("PRAGMA wal_checkpoint(TRUNCATE)");
}

void StoreRemoval::RemoveScan(const Actor& actor, const std::string& id,
                              const std::string& reason) {
  const std::optional<std::int64_t> number = ParseId(id);
  if (reason.empty()) throw StoreRefusal(ChangeResult::kInvalid, say::store::RemovalNeedsReason());
  const std::unique_lock removals = gate_.LockRemovals();
  {
    StoreChange change(database_);
    Statement query = change->Prepare(
        "SELECT outcome, EXISTS (SELECT 1 FROM refs WHERE scan_id = scans.id), patient_id FROM "
        "scans WHERE id = ?",
        number);
    if (!query.Step()) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoScan());
    if (query.Text(0) == "running")
      throw StoreRefusal(ChangeResult::kConflict, say::store::RemovalOfRunning());
    if (query.Integer(1) != 0)
      throw StoreRefusal(ChangeResult::kConflict, say::store::RemovalOfReference());
    NoteRemoved(change, ScanId(*number));
    NoteInBin(*change, *number, query.Integer(2));
    change->Run("DELETE FROM scans WHERE id = ?", *number);
    change.Log(actor, "scan.remove", ScanId(*number), Message::Verbatim(reason));
    change.Commit();
  }
  MoveToBin(folders_, ScanId(*number));
}

/// The scan's files are removed after the database's lock is released, so that a scan that begins
/// meanwhile does not wait for a slow disk.
bool StoreRemoval::ForgetScan(const std::string& scan_id, const Message& why, bool to_bin) {
  const std::unique_lock removals = gate_.LockRemovals();
  {
    StoreChange change(database_);
    const std::optional<std::int64_t> patient = change->FirstInteger(
        "DELETE FROM scans WHERE id = ? AND outcome <> 'running' AND id NOT IN (SELECT scan_id "
        "FROM refs) RETURNING patient_id",
        ParseId(scan_id));
    if (!patient) return false;
    NoteRemoved(change, scan_id);
    if (to_bin) NoteInBin(*change, ParseId(scan_id).value_or(0), *patient);
    change.Log(kSelf, "scan.remove", scan_id, why);
    change.Commit();
  }
  if (to_bin)
    MoveToBin(folders_, scan_id);
  else
    RemoveFiles(scan_id);
  return true;
}

/// Leaves out scans whose stored files cannot be seen now: removing them frees nothing, and the
/// files may come back. A scan whose files have changed is treated like any other.
void StoreRemoval::LeaveOutOfSight(std::vector<std::string>& scan_ids) {
  const std::vector<std::string> unavailable =
      database_.ForChanges()->All("SELECT id FROM scans WHERE unavailable <> ''", ReadScanId);
  std::erase_if(scan_ids, [&](const std::string& id) {
    std::error_code ignored;
    return std::ranges::find(unavailable, id) != unavailable.end() &&
           !fs::exists(folders_.Scan(id), ignored);
  });
}

/// Leaves out scans that no verified backup holds.
void StoreRemoval::LeaveUncopied(std::vector<std::string>& scan_ids, const RemovalRules& rules,
                                 Removals& done) {
  if (!rules.needs_backup || scan_ids.empty()) return;
  // Backups are verified each day; a time in the future comes from a wrong clock.
  constexpr std::chrono::microseconds kVerifiedWithin = std::chrono::hours(48);
  const std::int64_t now = StoredNow();
  const std::vector<std::string> copied = database_.ForChanges()->All(
      "SELECT DISTINCT scan_id FROM backup_scans JOIN backups ON backups.id = backup_id WHERE "
      "verified_at BETWEEN ? AND ? ORDER BY scan_id",
      ReadScanId, now - kVerifiedWithin.count(), now);
  done.uncopied += static_cast<int>(std::erase_if(
      scan_ids, [&](const std::string& id) { return !std::ranges::binary_search(copied, id); }));
}

/// Announces removals, withdraws the announcements of scans that need not go any more, and returns
/// the scans that may go now.
std::vector<std::string> StoreRemoval::Due(const std::vector<std::string>& scan_ids,
                                           const char* kind, const RemovalRules& rules,
                                           Removals& done) {
  const StoreDatabase::Held writer = database_.ForChanges();
  const std::int64_t now = StoredNow();
  const std::vector<std::string> announced = writer->All(
      "SELECT scan_id FROM removals WHERE kind = ? AND announced_at <= ?", ReadScanId, kind, now);
  std::vector<std::string> due;
  if (announced != scan_ids) {
    Transaction transaction(*writer);
    writer->Run("DELETE FROM removals WHERE kind = ? AND announced_at > ?", kind, now);
    for (const std::string& scan : announced) {
      if (std::ranges::find(scan_ids, scan) == scan_ids.end())
        writer->Run("DELETE FROM removals WHERE kind = ? AND scan_id = ?", kind, ParseId(scan));
    }
    for (const std::string& scan : scan_ids)
      writer->Run("INSERT OR IGNORE INTO removals (scan_id, kind, announced_at) VALUES (?, ?, ?)",
                  ParseId(scan), kind, now);
    transaction.Commit();
  }
  if (scan_ids.empty()) return due;
  const std::int64_t day_ago = now - std::chrono::microseconds(std::chrono::hours(24)).count();
  const std::int64_t week_ago = now - std::chrono::microseconds(std::chrono::hours(7 * 24)).count();
  const std::int64_t of_today =
      writer
          ->FirstInteger(
              "SELECT count(*) FROM audit WHERE action IN ('scan.remove', 'recording.remove') AND "
              "user = ? AND time BETWEEN ? AND ?",
              kSelf.user, day_ago, now)
          .value_or(0);
  const std::int64_t of_week =
      writer
          ->FirstInteger("SELECT count(*) FROM scans WHERE started_at BETWEEN ? AND ?", week_ago,
                         now)
          .value_or(0);
  const std::int64_t most = std::max<std::int64_t>(rules.most_a_day, 2 * of_week / 7) - of_today;
  const std::int64_t noticed = now - std::chrono::microseconds(rules.notice).count();
  for (const std::string& scan : scan_ids) {
    if (static_cast<std::int64_t>(due.size()) >= most) break;
    if (writer->Has("SELECT 1 FROM removals WHERE kind = ? AND scan_id = ? AND announced_at <= ?",
                    kind, ParseId(scan), noticed))
      due.push_back(scan);
  }
  done.announced += static_cast<int>(scan_ids.size() - due.size());
  return due;
}

Removals StoreRemoval::RemoveOldScans(int retention_days, const RemovalRules& rules,
                                      const std::stop_token& stop) {
  Removals done;
  if (stop.stop_requested()) return done;
  (void)EmptyBin(0, 0, stop);
  const WallClock::time_point now = WallClock::now();
  std::vector<std::string> old;
  // Clocks may step, but numbers only increase: no scan counts as older than its predecessor, and
  // times in the future are ignored.
  if (retention_days > 0)
    old = database_.ForChanges()->All(
        "SELECT id FROM (SELECT id, outcome, max(CASE WHEN started_at <= ? THEN started_at ELSE 0 "
        "END) OVER (ORDER BY id) AS since FROM scans) WHERE outcome <> 'running' AND since < ? AND "
        "id NOT IN (SELECT scan_id FROM refs) ORDER BY id",
        ReadScanId, ToStored(now), ToStored(now - std::chrono::hours(24) * retention_days));
  LeaveOutOfSight(old);
  LeaveUncopied(old, rules, done);
  for (const std::string& scan : Due(old, "retention", rules, done)) {
    if (stop.stop_requested()) break;
    done.removed += ForgetScan(scan, say::store::LogRetention(), /*to_bin=*/true) ? 1 : 0;
  }
  return done;
}

/// Its digest is removed first, so that the recording does not count as missing.
void StoreRemoval::ForgetRecording(const std::string& scan_id) {
  const std::unique_lock removals = gate_.LockRemovals();
  {
    StoreChange change(database_);
    change->Run("DELETE FROM scan_files WHERE scan_id = ? AND path = 'recording'",
                ParseId(scan_id));
    change.Log(kSelf, "recording.remove", scan_id, say::store::LogQuota());
    change.Commit();
  }
  std::error_code ignored;
  fs::remove_all(folders_.Scan(scan_id) / kRecordingFolder, ignored);
}

std::uint64_t DefaultQuota(std::uint64_t disk_bytes) {
  constexpr double kShare = 0.9;
  return static_cast<std::uint64_t>(kShare * static_cast<double>(disk_bytes));
}

/// Removes what has been in the bin for long enough, or everything if room is short.
/// @returns the bytes that scans then take
std::uint64_t StoreRemoval::EmptyBin(std::uint64_t bytes, std::uint64_t max_bytes,
                                     const std::stop_token& stop) {
  std::vector<std::string> taken;
  {
    const StoreDatabase::Held writer = database_.ForChanges();
    if (!writer->Has("SELECT 1 FROM bin")) return bytes;
    Transaction transaction(*writer);
    taken = TakeFromBin(*writer, bytes > max_bytes ? std::chrono::hours(0) : kTimeInBin);
    transaction.Commit();
  }
  for (const std::string& scan : taken) {
    bytes -= std::min(bytes, BytesOf(folders_.Bin(scan), stop));
    RemoveFiles(scan);
  }
  return bytes;
}

Removals StoreRemoval::KeepWithinQuota(std::uint64_t max_bytes, const RemovalRules& rules,
                                       const std::stop_token& stop) {
  Removals done;
  std::uint64_t bytes = BytesOf(folders_.scans(), stop);
  if (stop.stop_requested()) return done;
  if (bytes > max_bytes) bytes = EmptyBin(bytes, max_bytes, stop);
  std::vector<std::string> all, removable, recordings, scans;
  if (bytes > max_bytes) {
    const StoreDatabase::Held writer = database_.ForChanges();
    all = writer->All("SELECT id FROM scans WHERE has_folder = 1 ORDER BY id", ReadScanId);
    removable = writer->All(
        "SELECT id FROM scans WHERE has_folder = 1 AND id NOT IN (SELECT scan_id FROM refs) ORDER "
        "BY accepted_by <> '', id",
        ReadScanId);
  }
  LeaveOutOfSight(all);
  LeaveOutOfSight(removable);
  Removals of_recordings;  // not counted again: their scans are
  LeaveUncopied(all, rules, of_recordings);
  LeaveUncopied(removable, rules, done);
  for (const std::string& scan : all) {  // raw recordings are large, and nothing depends on them
    const fs::path recording = folders_.Scan(scan) / kRecordingFolder;
    std::error_code ignored;
    if (bytes <= max_bytes || stop.stop_requested() || !fs::exists(recording, ignored)) continue;
    bytes -= std::min(bytes, BytesOf(recording, stop));
    recordings.push_back(scan);
  }
  for (const std::string& scan : removable) {
    if (bytes <= max_bytes || stop.stop_requested()) break;
    bytes -= std::min(bytes, BytesOf(folders_.Scan(scan), stop));
    scans.push_back(scan);
  }
  if (bytes <= max_bytes) done.uncopied = 0;  // there is enough to remove
  for (const std::string& scan : Due(recordings, "recording", rules, done)) {
    if (stop.stop_requested()) return done;
    ForgetRecording(scan);
    ++done.removed;
  }
  for (const std::string& scan : Due(scans, "quota", rules, done)) {
    if (stop.stop_requested()) break;
    done.removed += ForgetScan(scan, say::store::LogQuota(), /*to_bin=*/false) ? 1 : 0;
  }
  return done;
}

}  // namespace plumb
