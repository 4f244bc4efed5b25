#include "daemon/records/store_removal.hpp"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "daemon/records/store_refusal.hpp"
#include "daemon/records/stored_values.hpp"

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
  if (backing_up_)
    throw StoreRefusal(ChangeResult::kConflict,
                       "a backup is being made, and nothing is removed meanwhile: try again when "
                       "it is done");
  return lock;
}

RemovalGate::Backup::Backup(RemovalGate& gate) : gate_(gate) {
  const std::lock_guard lock(gate_.mutex_);  // a removal in progress ends first
  if (gate_.backing_up_.exchange(true))
    throw StoreRefusal(ChangeResult::kConflict, "a backup is being made already");
}

void StoreRemoval::RemoveFiles(const std::string& scan_id) {
  std::error_code ignored;  // remaining files are removed at the next start
  fs::remove_all(folders_.Scan(scan_id), ignored);
  fs::remove_all(folders_.Staging(scan_id), ignored);
  for (const fs::path& folder : folders_.SetAsideAs(scan_id + ScanFolders::kInterruptedSuffix))
    fs::remove_all(folder, ignored);
}

void StoreRemoval::WipePatient(const Actor& actor, const std::string& id) {
  const std::int64_t number = RequireId(id, "patient");
  std::vector<std::string> scans;
  const std::unique_lock removals = gate_.LockRemovals();
  {
    StoreChange change(database_);
    scans = change->All("SELECT id FROM scans WHERE patient_id = ?", ReadScanId, number);
    if (change->Has("SELECT 1 FROM scans WHERE patient_id = ? AND id = ?", number,
                    scans_.running()))
      throw StoreRefusal(ChangeResult::kConflict,
                         "a scan of this patient is running: end or cancel it first");
    change->Run("UPDATE patients SET wiping = 1 WHERE id = ?", number);
    if (change->num_changed() == 0)
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
    for (const std::string& scan : scans) NoteRemoved(change, scan);
    change->Run("DELETE FROM refs WHERE patient_id = ?", number);
    change->Run("DELETE FROM patients WHERE id = ?", number);
    change.Log(actor, "patient.wipe", id, fmt::format("{} scans", scans.size()));
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
  if (reason.empty())
    throw StoreRefusal(ChangeResult::kInvalid, "a scan is removed for a reason: state it");
  const std::unique_lock removals = gate_.LockRemovals();
  {
    StoreChange change(database_);
    Statement query = change->Prepare(
        "SELECT outcome, EXISTS (SELECT 1 FROM refs WHERE scan_id = scans.id) FROM scans WHERE id "
        "= ?",
        number);
    if (!query.Step()) throw StoreRefusal(ChangeResult::kNotFound, "there is no such scan");
    if (query.Text(0) == "running")
      throw StoreRefusal(ChangeResult::kConflict, "this scan is running: discard it instead");
    if (query.Integer(1) != 0)
      throw StoreRefusal(
          ChangeResult::kConflict,
          "this scan is the source of a reference: it is deleted only with its patient");
    NoteRemoved(change, ScanId(*number));
    change->Run("DELETE FROM scans WHERE id = ?", *number);
    change.Log(actor, "scan.remove", ScanId(*number), reason);
    change.Commit();
  }
  RemoveFiles(ScanId(*number));
}

/// Its files are removed after the lock is released: a scan that begins meanwhile must not wait for
/// a slow disk.
bool StoreRemoval::ForgetScan(const std::string& scan_id, const char* why) {
  const std::unique_lock removals = gate_.LockRemovals();
  {
    StoreChange change(database_);
    change->Run(
        "DELETE FROM scans WHERE id = ? AND outcome <> 'running' AND id NOT IN (SELECT scan_id "
        "FROM refs)",
        ParseId(scan_id));
    if (change->num_changed() == 0) return false;
    NoteRemoved(change, scan_id);
    change.Log(kSelf, "scan.remove", scan_id, why);
    change.Commit();
  }
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

int StoreRemoval::RemoveOldScans(int retention_days, const std::stop_token& stop) {
  if (retention_days <= 0) return 0;
  const WallClock::time_point now = WallClock::now();
  // Numbers only increase while clocks may step: no scan is older than its predecessor, and times
  // in the future are wrong.
  std::vector<std::string> old = database_.ForChanges()->All(
      "SELECT id FROM (SELECT id, outcome, max(CASE WHEN started_at <= ? THEN started_at ELSE 0 "
      "END) OVER (ORDER BY id) AS since FROM scans) WHERE outcome <> 'running' AND since < ? AND "
      "id NOT IN (SELECT scan_id FROM refs) ORDER BY id",
      ReadScanId, ToStored(now), ToStored(now - std::chrono::hours(24) * retention_days));
  LeaveOutOfSight(old);
  int num_removed = 0;
  for (const std::string& scan : old) {
    if (stop.stop_requested()) break;
    num_removed += ForgetScan(scan, "retention") ? 1 : 0;
  }
  return num_removed;
}

/// Its digest is removed first, so that the recording does not count as missing.
void StoreRemoval::ForgetRecording(const std::string& scan_id) {
  const std::unique_lock removals = gate_.LockRemovals();
  {
    StoreChange change(database_);
    change->Run("DELETE FROM scan_files WHERE scan_id = ? AND path = 'recording'",
                ParseId(scan_id));
    change.Log(kSelf, "recording.remove", scan_id, "quota");
    change.Commit();
  }
  std::error_code ignored;
  fs::remove_all(folders_.Scan(scan_id) / kRecordingFolder, ignored);
}

std::uint64_t DefaultQuota(std::uint64_t scan_bytes, std::uint64_t free_bytes) {
  constexpr double kShare = 0.9;
  return static_cast<std::uint64_t>(kShare * static_cast<double>(scan_bytes + free_bytes));
}

int StoreRemoval::KeepWithinQuota(std::uint64_t max_bytes, const std::stop_token& stop) {
  return RemoveOldest(
      BytesOf(folders_.scans(), stop), max_bytes, [] { return true; }, stop);
}

StoreRemoval::Room StoreRemoval::KeepWithinRoom(
    const std::function<std::optional<std::uint64_t>()>& free_bytes, const std::stop_token& stop) {
  Room room;
  std::optional<std::uint64_t> free = free_bytes();
  if (!free) return room;
  const std::uint64_t bytes = BytesOf(folders_.scans(), stop);
  const std::uint64_t quota = DefaultQuota(bytes, *free);
  const auto has_helped = [&] {
    const auto before = std::exchange(free, free_bytes());
    room.has_helped = free > before;  // nothing is less than any number
    return room.has_helped;
  };
  room.num_removed = RemoveOldest(bytes, quota, has_helped, stop);
  return room;
}

/// @param has_helped  Asked after each removal: false ends it.
int StoreRemoval::RemoveOldest(std::uint64_t bytes, std::uint64_t max_bytes,
                               const std::function<bool()>& has_helped,
                               const std::stop_token& stop) {
  if (bytes <= max_bytes) return 0;
  int num_touched = 0;
  std::vector<std::string> all, removable;
  {
    const StoreDatabase::Held writer = database_.ForChanges();
    all = writer->All("SELECT id FROM scans WHERE has_folder = 1 ORDER BY id", ReadScanId);
    removable = writer->All(
        "SELECT id FROM scans WHERE has_folder = 1 AND id NOT IN (SELECT scan_id FROM refs) ORDER "
        "BY id",
        ReadScanId);
  }
  LeaveOutOfSight(all);
  LeaveOutOfSight(removable);
  for (const std::string& scan : all) {  // raw recordings are large, and nothing depends on them
    const fs::path recording = folders_.Scan(scan) / kRecordingFolder;
    std::error_code ignored;
    if (bytes <= max_bytes || stop.stop_requested() || !fs::exists(recording, ignored)) continue;
    bytes -= std::min(bytes, BytesOf(recording, stop));
    ForgetRecording(scan);
    ++num_touched;
    if (!has_helped()) return num_touched;
  }
  for (const std::string& scan : removable) {
    if (bytes <= max_bytes || stop.stop_requested()) break;
    const std::uint64_t its_bytes = BytesOf(folders_.Scan(scan), stop);
    if (!ForgetScan(scan, "quota")) continue;  // it has become a reference
    bytes -= std::min(bytes, its_bytes);
    ++num_touched;
    if (!has_helped()) break;
  }
  return num_touched;
}

}  // namespace plumb
