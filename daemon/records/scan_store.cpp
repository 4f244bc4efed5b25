// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/scan_store.hpp"

#include <cerrno>
#include <cstdio>
#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/database/scan_digests.hpp"
#include "daemon/database/store_json.hpp"
#include "daemon/database/store_refusal.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/state_folder/scan_numbers.hpp"
#include "drivers/files/file_io.hpp"
#include "words/store.hpp"

namespace plumb {

namespace fs = std::filesystem;

namespace {

const std::string kScanColumns =
    "SELECT scans.id, patient_id, reference_id, purpose, outcome, failure, started_at, "
    "finished_at, accepted_by, has_folder, results.json, accepted_reason, session_id, "
    "(SELECT fraction FROM sessions WHERE sessions.id = session_id), sensor_on_s, check_overdue, "
    "unavailable, accepted_at, sensor_serial, (SELECT opened_by FROM sessions WHERE sessions.id = "
    "session_id), failure_message, unavailable_message, (SELECT sha256 FROM scan_files WHERE "
    "scan_files.scan_id = scans.id AND path = 'result/result.json') FROM scans LEFT JOIN results "
    "ON "
    "results.scan_id = scans.id ";

/// The column check_overdue stores the value of the enum. Older versions read every value but 0 as
/// overdue.
DailyCheck DailyCheckOf(std::int64_t stored) {
  static_assert(static_cast<int>(DailyCheck::kPassed) == 0 &&
                static_cast<int>(DailyCheck::kOverdue) == 1 &&
                static_cast<int>(DailyCheck::kFailed) == 2);
  return stored == 0   ? DailyCheck::kPassed
         : stored == 2 ? DailyCheck::kFailed
                       : DailyCheck::kOverdue;
}

/// @param sync  SyncToDisk or SyncWholeDisk. @throws DiskRefused
void Flush(const fs::path& folder, void (*sync)(const fs::path&)) {
  try {
    sync(folder);
  } catch (const IoError& error) {
    throw DiskRefused(error.message());
  }
}

/// The result in the database is the text of result.json, whose digest is stored with the scan.
/// @param sha256  Empty: the scan has no such file. @throws DataError
ResultSummary ResultIn(const std::string& scan_id, const std::string& json,
                       const std::string& sha256) {
  if (!sha256.empty() && Sha256Of(json) != sha256)
    throw DataError(say::store::ResultNotAsStored(scan_id));
  return SummaryOf(json);
}

/// Verdict and numbers for the log: "move, vertical +1.20 mm, ..., yaw -0.10 deg".
std::vector<Message> Described(const ResultSummary& result) {
  std::vector<Message> words = {say::store::LogVerdict(Name(result.verdict))};
  for (const NumberAxis& axis : kNumberAxes) {
    if (const auto value = axis.In(result.correction))
      words.push_back(axis.is_shift() ? say::store::LogNumberMm(axis.name, *value)
                                      : say::store::LogNumberDeg(axis.name, *value));
  }
  return words;
}

}  // namespace

/// @throws DataError where the row or its result cannot be read: nothing of it is ever a default.
Scan ScanStore::ReadScan(const Statement& row) const {
  Scan scan{.id = ScanId(row.Integer(0)),
            .patient_id = row.Integer(1) == 0 ? std::string() : row.Text(1),
            .reference_id = row.Text(2),
            .purpose = ParseStored<ScanPurpose>("purpose", row.Text(3)),
            .outcome = ParseStored<ScanOutcome>("outcome", row.Text(4)),
            .failure = MessageIn(row.Text(20), row.Text(5)),
            .started_at = FromStored(row.Integer(6)),
            .accepted_by = row.Text(8),
            .accepted_reason = row.Text(11),
            .session_id = row.Text(12),
            .fraction = static_cast<int>(row.Integer(13)),
            .daily_check = DailyCheckOf(row.Integer(15)),
            .sensor_serial = row.Text(18),
            .session_by = row.Text(19)};
  if (!row.IsNull(14)) scan.sensor_on_s = row.Real(14);
  if (!row.IsNull(17)) scan.accepted_at = FromStored(row.Integer(17));
  if (!row.IsNull(7)) scan.finished_at = FromStored(row.Integer(7));
  if (const std::string unavailable = row.Text(16); !unavailable.empty()) {
    scan.failure = say::store::FilesUnusable(MessageIn(row.Text(21), unavailable));
  } else if (row.Integer(9) != 0) {
    scan.folder = folders_.Scan(scan.id);
  }
  if (!row.IsNull(10)) scan.result = ResultIn(scan.id, row.Text(10), row.Text(22));
  return scan;
}

/// For lists: one that cannot be read does not hide the others. It has no result, and says why.
Scan ScanStore::ListScan(const Statement& row) const {
  try {
    return ReadScan(row);
  } catch (const DataError& error) {
    Scan scan;
    scan.id = ScanId(row.Integer(0));
    if (row.Integer(1) != 0) scan.patient_id = row.Text(1);
    scan.outcome = ScanOutcome::kFailed;
    scan.failure = error.message();
    scan.started_at = FromStored(row.Integer(6));
    return scan;
  }
}

void FailInterruptedScans(Database& database) {
  const Message why = say::store::Interrupted();
  database.Run(
      "UPDATE scans SET outcome = 'failed', failure = ?, failure_message = ?, has_folder = 0 WHERE "
      "outcome = 'running'",
      why.English(), MessageColumn(why));
}

std::vector<Scan> ScanStore::List(const std::string& patient_id, int limit) {
  const auto read = [this](const Statement& row) { return ListScan(row); };
  if (patient_id.empty())
    return database_.ForLists()->All(kScanColumns + "ORDER BY scans.id DESC LIMIT ?", read, limit);
  return database_.ForLists()->All(
      kScanColumns + "WHERE patient_id = ? ORDER BY scans.id DESC LIMIT ?", read,
      ParseId(patient_id), limit);
}

std::optional<Scan> ScanStore::Find(const std::string& id) {
  return database_.ForRows()->First(
      kScanColumns + "WHERE scans.id = ?", [this](const Statement& row) { return ReadScan(row); },
      ParseId(id));
}

int ScanStore::CountSince(const std::string& patient_id, WallClock::time_point since) {
  const std::optional<std::int64_t> count = database_.ForRows()->FirstInteger(
      "SELECT count(*) FROM scans WHERE patient_id = ? AND outcome = 'done' AND started_at >= ?",
      ParseId(patient_id), ToStored(since));
  return static_cast<int>(count.value_or(0));
}

std::optional<std::string> ScanStore::NewestWithFiles() {
  return database_.ForRows()->First(
      "SELECT id FROM scans WHERE has_folder = 1 ORDER BY id DESC LIMIT 1",
      [](const Statement& row) { return ScanId(row.Integer(0)); });
}

double ScanStore::SweptArea(const std::string& scan_id) {
  const auto read = [](const Statement& row) { return row.Real(0); };
  return database_.ForRows()
      ->First("SELECT swept_area_m2 FROM scans WHERE id = ?", read, ParseId(scan_id))
      .value_or(0.0);
}

std::string ScanStore::Begin(const NewScan& scan) {
  StoreChange change(database_);
  // a scan whose end could not be recorded because of the disk
  FailInterruptedScans(*change);
  const std::int64_t patient = ParseId(scan.patient_id).value_or(0);  // 0: of no patient
  change->Run(
      "INSERT INTO scans (patient_id, reference_id, purpose, outcome, started_at, sensor_serial, "
      "reason, session_id, sensor_on_s, check_overdue) VALUES (?, ?, ?, 'running', ?, ?, ?, ?, ?, "
      "?)",
      patient, ParseId(scan.reference_id), Name(scan.purpose), StoredNow(), scan.sensor_serial,
      scan.reason, ParseId(scan.session_id), scan.sensor_on_s,
      static_cast<std::int64_t>(scan.daily_check));
  const std::int64_t number = change->last_id();
  const std::string id = ScanId(number);
  std::error_code error;
  fs::remove_all(folders_.Staging(id), error);
  fs::create_directory(folders_.Staging(id), error);
  if (error) throw DiskRefused(DescribeWriteError(folders_.Staging(id), error.value()));
  change.Commit();
  NoteScanNumber(folders_.state(), number);
  running_ = number;
  return id;
}

void ScanStore::Finish(const std::string& scan_id, const FinishedScan& finished) {
  const bool is_done = finished.outcome == ScanOutcome::kDone;
  const fs::path staging = folders_.Staging(scan_id);
  std::error_code ignored;
  // A failed sweep is kept for inspection if its recording is complete.
  const bool has_recording = fs::exists(staging / kRecordingFolder / "rgb.txt", ignored);
  const bool is_kept = is_done || (finished.outcome == ScanOutcome::kFailed && has_recording);
  // Read before the lock is taken, so that nothing else waits for it.
  const std::vector<FileDigest> files =
      is_done ? DigestsOfScan(staging) : std::vector<FileDigest>();
  const StoreDatabase::Held writer = database_.ForChanges();
  running_.reset();
  if (!is_kept) {
    fs::remove_all(staging, ignored);
    return NoteEnd(*writer, scan_id, finished, is_kept, {});
  }
  if (!is_done) {
    for (const char* part : {"scene", "result"}) fs::remove_all(staging / part, ignored);
  }
  // Scene and result are on the disk; a recording has too many images to flush them one by one.
  if (fs::exists(staging / kRecordingFolder, ignored)) Flush(folders_.scans(), SyncWholeDisk);
  if (::rename(staging.c_str(), folders_.Scan(scan_id).c_str()) != 0) {
    throw DiskRefused(DescribeWriteError(folders_.Scan(scan_id), errno));
  }
  try {
    Flush(folders_.scans(), SyncToDisk);
    NoteEnd(*writer, scan_id, finished, is_kept, files);
    (void)writer->Checkpoint();  // if this fails, a later change does it
  } catch (...) {                // without its row a scan does not exist
    ::rename(folders_.Scan(scan_id).c_str(), staging.c_str());
    throw;
  }
}

std::string ScanStore::AddMade(const NewScan& scan, const fs::path& made) {
  const std::vector<FileDigest> files = DigestsOfScan(made);
  StoreChange change(database_);
  const std::int64_t now = StoredNow();
  change->Run(
      "INSERT INTO scans (patient_id, purpose, outcome, started_at, finished_at, sensor_serial, "
      "reason, has_folder) VALUES (?, ?, 'done', ?, ?, '', ?, 1)",
      ParseId(scan.patient_id).value_or(0), Name(scan.purpose), now, now, scan.reason);
  const std::int64_t number = change->last_id();
  const std::string id = ScanId(number);
  StoreDigests(*change, number, files);
  NoteScanNumber(folders_.state(), number);
  if (::rename(made.c_str(), folders_.Scan(id).c_str()) != 0)
    throw DiskRefused(DescribeWriteError(folders_.Scan(id), errno));
  try {
    Flush(folders_.scans(), SyncToDisk);
    change.Commit();
  } catch (...) {  // without its row a scan does not exist
    ::rename(folders_.Scan(id).c_str(), made.c_str());
    throw;
  }
  return id;
}

void ScanStore::NoteEnd(Database& database, const std::string& scan_id,
                        const FinishedScan& finished, bool has_folder,
                        const std::vector<FileDigest>& files) {
  const std::int64_t number = ParseId(scan_id).value_or(0);
  Transaction transaction(database);
  database.Run(
      "UPDATE scans SET outcome = ?, failure = ?, failure_message = ?, finished_at = ?, "
      "swept_area_m2 = ?, has_folder = ? WHERE id = ?",
      Name(finished.outcome), finished.failure.English(), MessageColumn(finished.failure),
      StoredNow(), finished.swept_area_m2, has_folder, number);
  if (finished.outcome == ScanOutcome::kDone && !finished.result_json.empty()) {
    database.Run("INSERT INTO results (scan_id, json) VALUES (?, ?)", number, finished.result_json);
  }
  StoreDigests(database, number, files);
  transaction.Commit();
}

void ScanStore::AddFile(const std::string& scan_id, const std::string& path) {
  const FileDigest digest = DigestOfFile(folders_.Scan(scan_id), path);
  const std::optional<std::int64_t> number = ParseId(scan_id);
  StoreChange change(database_);
  if (!change->Has("SELECT 1 FROM scans WHERE id = ? AND has_folder = 1", number)) return;
  StoreDigests(*change, *number, {digest});
  change.Commit();
}

void ScanStore::Accept(const Actor& actor, const std::string& id, const std::string& reason) {
  const std::optional<std::int64_t> number = ParseId(id);
  StoreChange change(database_);
  std::vector<Message> described;
  {
    Statement query = change->Prepare(
        "SELECT outcome, accepted_by, (SELECT json FROM results WHERE scan_id = scans.id), (SELECT "
        "sha256 FROM scan_files WHERE scan_id = scans.id AND path = 'result/result.json'), "
        "EXISTS (SELECT 1 FROM scans AS newer WHERE newer.patient_id = scans.patient_id AND "
        "newer.id > scans.id AND newer.outcome IN ('done', 'running')), reference_id = "
        "ifnull((SELECT reference_id FROM sessions WHERE sessions.id = session_id), (SELECT id "
        "FROM refs WHERE refs.patient_id = scans.patient_id AND approved_by <> '' ORDER BY version "
        "DESC LIMIT 1)) FROM scans WHERE id = ?",
        number);
    if (!query.Step()) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoScan());
    if (query.Text(0) != "done" || query.IsNull(2)) {
      throw StoreRefusal(ChangeResult::kConflict, say::store::ScanWithoutResult());
    }
    const ResultSummary result = ResultIn(id, query.Text(2), query.Text(3));
    if (result.verdict == Verdict::kNoAnswer)
      throw StoreRefusal(ChangeResult::kConflict, say::store::ScanWithoutAnswer());
    if (!query.Text(1).empty())
      throw StoreRefusal(ChangeResult::kConflict, say::store::ScanAccepted());
    if (query.Integer(4) != 0)
      throw StoreRefusal(ChangeResult::kConflict, say::store::ScanNotNewest());
    if (query.Integer(5) == 0)
      throw StoreRefusal(ChangeResult::kConflict, say::store::ScanOfOtherReference());
    if (result.verdict != Verdict::kInTolerance && reason.empty())
      throw StoreRefusal(ChangeResult::kConflict, say::store::ScanNeedsReason());
    described = Described(result);
  }
  change->Run("UPDATE scans SET accepted_by = ?, accepted_reason = ?, accepted_at = ? WHERE id = ?",
              actor.user, reason, StoredNow(), number);
  change.Log(actor, reason.empty() ? "scan.accept" : "scan.accept_outside", id,
             reason.empty() ? say::store::LogAccepted(std::move(described))
                            : say::store::LogAcceptedOutside(std::move(described), reason));
  change.Commit();
}

std::vector<std::string> ScanStore::ToArchive(WallClock::time_point since) {
  return database_.ForRows()->All(
      "SELECT id FROM scans WHERE accepted_by <> '' AND accepted_at >= ? AND has_folder = 1 AND id "
      "NOT IN (SELECT scan_id FROM archived) ORDER BY accepted_at, id LIMIT 1000",
      [](const Statement& row) { return ScanId(row.Integer(0)); }, ToStored(since));
}

void ScanStore::NoteArchived(const std::string& id, const std::string& archive) {
  const std::optional<std::int64_t> number = ParseId(id);
  StoreChange change(database_);
  if (!change->Has("SELECT 1 FROM scans WHERE id = ?", number)) return;
  change->Run("INSERT INTO archived (scan_id, archive, stored_at) VALUES (?, ?, ?)", number,
              archive, StoredNow());
  change.Log(kSelf, "scan.archived", id, say::store::LogArchived(archive));
  change.Commit();
}

}  // namespace plumb
