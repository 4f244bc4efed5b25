// Scans and their folders: how they begin, end, are accepted and removed.
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

#include <fmt/format.h>

#include "daemon/records/store.hpp"
#include "daemon/records/store_internal.hpp"
#include "daemon/records/store_json.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {

namespace fs = std::filesystem;
using store::FromStored;
using store::ParseId;
using store::ScanId;
using store::ToStored;
using web::ChangeResult;

namespace {

constexpr const char* kScanColumns =
    "SELECT scans.id, patient_id, reference_id, purpose, outcome, failure, started_at, "
    "finished_at, accepted_by, has_folder, results.json, accepted_reason, session_id, "
    "(SELECT fraction FROM sessions WHERE sessions.id = session_id), sensor_on_s, check_overdue, "
    "unavailable, accepted_at FROM scans LEFT JOIN results ON results.scan_id = scans.id ";

web::Scan ReadScan(const Statement& row, const Store& store) {
  web::Scan scan{.id = ScanId(row.Integer(0)),
                 .patient_id = row.Integer(1) == 0 ? std::string() : row.Text(1),
                 .reference_id = row.Text(2),
                 .purpose = store::ParsePurpose(row.Text(3)),
                 .outcome = store::ParseOutcome(row.Text(4)),
                 .failure = row.Text(5),
                 .started_at = FromStored(row.Integer(6)),
                 .finished_at = {},
                 .result = {},
                 .accepted_by = row.Text(8),
                 .accepted_reason = row.Text(11),
                 .accepted_at = {},
                 .session_id = row.Text(12),
                 .fraction = static_cast<int>(row.Integer(13)),
                 .sensor_on_s = {},
                 .check_overdue = row.Integer(15) != 0,
                 .folder = {}};
  if (!row.IsNull(14)) scan.sensor_on_s = row.Real(14);
  if (!row.IsNull(17)) scan.accepted_at = FromStored(row.Integer(17));
  if (!row.IsNull(7)) scan.finished_at = FromStored(row.Integer(7));
  if (const std::string unavailable = row.Text(16); !unavailable.empty()) {
    scan.failure = "its files cannot be used now: " + unavailable;
  } else if (row.Integer(9) != 0) {
    scan.folder = store.ScanFolder(scan.id);
  }
  if (!row.IsNull(10)) scan.result = SummaryOf(row.Text(10));
  return scan;
}

/// Of a folder, or with ::syncfs of everything on its disk.
void Sync(const fs::path& folder, int (*sync)(int) = ::fsync) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) throw DiskRefused(DescribeWriteError(folder, errno));
  const int result = sync(descriptor);
  const int error = errno;
  ::close(descriptor);
  if (result != 0 && error != EINVAL) throw DiskRefused(DescribeWriteError(folder, error));
}

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

}  // namespace

fs::path Store::ScanFolder(const std::string& scan_id) const { return folder_ / "scans" / scan_id; }
fs::path Store::StagingFolder(const std::string& scan_id) const {
  return folder_ / "scans" / (".staging-" + scan_id);
}

std::vector<web::Scan> Store::Scans(const std::string& patient_id, int limit) {
  std::vector<web::Scan> scans;
  const std::optional<std::int64_t> number = ParseId(patient_id);
  if (!number && !patient_id.empty()) return scans;
  const std::lock_guard lock(list_mutex_);
  static const std::string kAll = std::string(kScanColumns) + "ORDER BY scans.id DESC LIMIT ?";
  static const std::string kOfPatient =
      std::string(kScanColumns) + "WHERE patient_id = ? ORDER BY scans.id DESC LIMIT ?";
  Statement query = list_->Prepare(number ? kOfPatient.c_str() : kAll.c_str());
  if (number) query.Bind(*number);
  query.Bind(std::int64_t{limit});
  while (query.Step()) scans.push_back(ReadScan(query, *this));
  return scans;
}

std::optional<web::Scan> Store::FindScan(const std::string& id) {
  const std::optional<std::int64_t> number = ParseId(id);
  if (!number) return std::nullopt;
  const std::lock_guard lock(read_mutex_);
  static const std::string kSql = std::string(kScanColumns) + "WHERE scans.id = ?";
  Statement query = read_->Prepare(kSql.c_str());
  return query.Bind(*number).Step() ? std::optional(ReadScan(query, *this)) : std::nullopt;
}

int Store::ScansSince(const std::string& patient_id, web::WallClock::time_point since) {
  const std::optional<std::int64_t> number = ParseId(patient_id);
  if (!number) return 0;
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
      "SELECT count(*) FROM scans WHERE patient_id = ? AND outcome = 'done' AND started_at >= ?");
  return query.Bind(*number).Bind(ToStored(since)).Step() ? static_cast<int>(query.Integer(0)) : 0;
}

double Store::SweptArea(const std::string& scan_id) {
  const std::optional<std::int64_t> number = ParseId(scan_id);
  if (!number) return 0.0;
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare("SELECT swept_area_m2 FROM scans WHERE id = ?");
  return query.Bind(*number).Step() ? query.Real(0) : 0.0;
}

std::string Store::BeginScan(const NewScan& scan) {
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  FailInterrupted();  // one whose end the disk refused to note
  write_
      ->Prepare(
          "INSERT INTO scans (patient_id, reference_id, purpose, outcome, started_at, "
          "sensor_serial, reason, session_id, sensor_on_s, check_overdue)"
          " VALUES (?, ?, ?, 'running', ?, ?, ?, ?, ?, ?)")
      .Bind(ParseId(scan.patient_id).value_or(0))  // 0: of no patient
      .Bind(ParseId(scan.reference_id))
      .Bind(store::Name(scan.purpose))
      .Bind(ToStored(web::WallClock::now()))
      .Bind(scan.sensor_serial)
      .Bind(scan.reason)
      .Bind(ParseId(scan.session_id))
      .Bind(scan.sensor_on_s)
      .Bind(std::int64_t{scan.check_overdue})
      .Run();
  const std::int64_t number = write_->last_id();
  const std::string id = ScanId(number);
  std::error_code error;
  fs::remove_all(StagingFolder(id), error);
  fs::create_directory(StagingFolder(id), error);
  if (error) throw DiskRefused(DescribeWriteError(StagingFolder(id), error.value()));
  transaction.Commit();
  running_ = number;
  return id;
}

void Store::FailInterrupted() {
  write_
      ->Prepare(
          "UPDATE scans SET outcome = 'failed', failure = ?, has_folder = 0 WHERE outcome = "
          "'running'")
      .Bind(store::kInterrupted)
      .Run();
}

void Store::FinishScan(const std::string& scan_id, const FinishedScan& finished) {
  const bool is_done = finished.outcome == web::ScanOutcome::kDone;
  const fs::path staging = StagingFolder(scan_id);
  std::error_code ignored;
  // The sweep that failed is the one to be looked at. Its images count where all of them are there.
  const bool has_recording = fs::exists(staging / kRecordingFolder / "rgb.txt", ignored);
  const bool is_kept = is_done || (finished.outcome == web::ScanOutcome::kFailed && has_recording);
  // Read before the lock is taken: nobody else waits for it.
  const std::vector<FileDigest> files =
      is_done ? DigestsOfScan(staging) : std::vector<FileDigest>();
  const std::lock_guard lock(write_mutex_);
  running_.reset();
  if (!is_kept) {
    fs::remove_all(staging, ignored);
    return NoteEnd(scan_id, finished, is_kept, {});
  }
  if (!is_done) {
    for (const char* part : {"scene", "result"}) fs::remove_all(staging / part, ignored);
  }
  // Scene and result are on the disk; the images of a recording are too many to be synced one by
  // one.
  if (fs::exists(staging / kRecordingFolder, ignored)) Sync(folder_ / "scans", ::syncfs);
  if (::rename(staging.c_str(), ScanFolder(scan_id).c_str()) != 0) {
    throw DiskRefused(DescribeWriteError(ScanFolder(scan_id), errno));
  }
  try {
    Sync(folder_ / "scans");
    NoteEnd(scan_id, finished, is_kept, files);
  } catch (...) {  // without its row it is none
    ::rename(ScanFolder(scan_id).c_str(), staging.c_str());
    throw;
  }
}

void Store::NoteEnd(const std::string& scan_id, const FinishedScan& finished, bool has_folder,
                    const std::vector<FileDigest>& files) {
  const std::int64_t number = ParseId(scan_id).value_or(0);
  Transaction transaction(*write_);
  write_
      ->Prepare(
          "UPDATE scans SET outcome = ?, failure = ?, finished_at = ?, swept_area_m2 = ?, "
          "has_folder = ? WHERE id = ?")
      .Bind(store::Name(finished.outcome))
      .Bind(finished.failure)
      .Bind(ToStored(web::WallClock::now()))
      .Bind(finished.swept_area_m2)
      .Bind(std::int64_t{has_folder})
      .Bind(number)
      .Run();
  if (!finished.result_json.empty()) {
    write_->Prepare("INSERT INTO results (scan_id, json) VALUES (?, ?)")
        .Bind(number)
        .Bind(finished.result_json)
        .Run();
  }
  StoreDigests(number, files);
  transaction.Commit();
}

namespace {

/// Verdict and numbers, for the log: "move: vertical +1.2, ..., yaw -0.10".
std::string Described(const web::ResultSummary& result) {
  std::string text = result.verdict;
  if (!result.correction) return text;
  const web::SixNumbers& c = *result.correction;
  const auto add = [&](const char* name, const std::optional<double>& value, const char* unit) {
    if (value) text += fmt::format(", {} {:+.2f} {}", name, *value, unit);
  };
  add("vertical", c.vertical_mm, "mm");
  add("longitudinal", c.longitudinal_mm, "mm");
  add("lateral", c.lateral_mm, "mm");
  add("pitch", c.pitch_deg, "deg");
  add("roll", c.roll_deg, "deg");
  add("yaw", c.yaw_deg, "deg");
  return text;
}

}  // namespace

void Store::AcceptScan(const web::Actor& actor, const std::string& id, const std::string& reason) {
  const std::optional<std::int64_t> number = ParseId(id);
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  std::string described;
  {
    Statement query = write_->Prepare(
        "SELECT outcome, accepted_by, (SELECT json FROM results WHERE scan_id = scans.id), "
        "EXISTS (SELECT 1 FROM scans AS newer WHERE newer.patient_id = scans.patient_id AND "
        "newer.id > scans.id AND newer.outcome IN ('done', 'running')) FROM scans WHERE id = ?");
    if (!number || !query.Bind(*number).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such scan");
    if (query.Text(0) != "done" || query.IsNull(2)) {
      throw StoreRefusal(ChangeResult::kConflict,
                         "this scan has no result: only a compared scan is accepted");
    }
    const web::ResultSummary result = SummaryOf(query.Text(2));
    if (result.verdict == "no_answer")
      throw StoreRefusal(ChangeResult::kConflict,
                         "this scan gave no answer: there is nothing to accept");
    if (!query.Text(1).empty())
      throw StoreRefusal(ChangeResult::kConflict, "this scan is accepted already");
    if (query.Integer(3) != 0)
      throw StoreRefusal(ChangeResult::kConflict,
                         "there is a newer scan of this patient: accept that one");
    if (result.verdict != "in_tolerance" && reason.empty())
      throw StoreRefusal(ChangeResult::kConflict,
                         "this result is not in tolerance: accepting it requires a reason and "
                         "your password");
    described = Described(result);
  }
  write_
      ->Prepare(
          "UPDATE scans SET accepted_by = ?, accepted_reason = ?, accepted_at = ? WHERE id = ?")
      .Bind(actor.user)
      .Bind(reason)
      .Bind(ToStored(web::WallClock::now()))
      .Bind(*number)
      .Run();
  Write(actor, reason.empty() ? "scan.accept" : "scan.accept_outside", id,
        reason.empty() ? described : described + "; reason: " + reason);
  transaction.Commit();
}

/// So that a start tells what was removed from what it cannot explain.
void Store::NoteRemoved(const std::string& scan_id) {
  write_->Prepare("INSERT OR IGNORE INTO removed_scans (id) VALUES (?)")
      .Bind(ParseId(scan_id))
      .Run();
}

void Store::RemoveScanFiles(const std::string& scan_id) {
  std::error_code ignored;  // what stays goes at the next start
  fs::remove_all(ScanFolder(scan_id), ignored);
  fs::remove_all(StagingFolder(scan_id), ignored);
  fs::remove_all(folder_ / "set-aside" / (scan_id + store::kInterruptedSuffix), ignored);
}

std::vector<std::string> Store::ScansOf(Statement query) {
  std::vector<std::string> scans;
  while (query.Step()) scans.push_back(ScanId(query.Integer(0)));
  return scans;
}

void Store::RemoveScan(const web::Actor& actor, const std::string& id, const std::string& reason) {
  const std::optional<std::int64_t> number = ParseId(id);
  if (reason.empty())
    throw StoreRefusal(ChangeResult::kInvalid, "a scan is removed for a reason: state it");
  const std::unique_lock removals = LockRemovals();
  {
    const std::lock_guard lock(write_mutex_);
    Transaction transaction(*write_);
    Statement query = write_->Prepare(
        "SELECT outcome, EXISTS (SELECT 1 FROM refs WHERE scan_id = scans.id) FROM scans WHERE id "
        "= ?");
    if (!number || !query.Bind(*number).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such scan");
    if (query.Text(0) == "running")
      throw StoreRefusal(ChangeResult::kConflict, "this scan is running: discard it instead");
    if (query.Integer(1) != 0)
      throw StoreRefusal(ChangeResult::kConflict,
                         "a reference is made of this scan: it goes only with its patient");
    NoteRemoved(ScanId(*number));
    write_->Prepare("DELETE FROM scans WHERE id = ?").Bind(*number).Run();
    Write(actor, "scan.remove", ScanId(*number), reason);
    transaction.Commit();
  }
  RemoveScanFiles(ScanId(*number));
}

/// Its files go after the lock is free: a scan that begins meanwhile must not wait for a slow disk.
bool Store::ForgetScan(const std::string& scan_id) {
  const std::unique_lock removals = LockRemovals();
  {
    const std::lock_guard lock(write_mutex_);
    Transaction transaction(*write_);
    write_
        ->Prepare(
            "DELETE FROM scans WHERE id = ? AND outcome <> 'running' AND id NOT IN (SELECT scan_id "
            "FROM refs)")
        .Bind(ParseId(scan_id))
        .Run();
    if (write_->num_changed() == 0) return false;
    NoteRemoved(scan_id);
    Write(store::kSelf, "scan.remove", scan_id, "retention");
    transaction.Commit();
  }
  RemoveScanFiles(scan_id);
  return true;
}

int Store::RemoveOldScans(int retention_days, const std::stop_token& stop) {
  if (retention_days <= 0) return 0;
  const web::WallClock::time_point now = web::WallClock::now();
  std::vector<std::string> old;
  {
    const std::lock_guard lock(write_mutex_);
    // Numbers only count up while clocks step: no scan is older than one before it, and stamps of
    // the future are wrong.
    Statement query = write_->Prepare(
        "SELECT id FROM (SELECT id, outcome, max(CASE WHEN started_at <= ? THEN started_at ELSE 0 "
        "END) OVER (ORDER BY id) AS since"
        " FROM scans) WHERE outcome <> 'running' AND since < ? AND id NOT IN (SELECT scan_id FROM "
        "refs) ORDER BY id");
    query.Bind(ToStored(now)).Bind(ToStored(now - std::chrono::hours(24) * retention_days));
    old = ScansOf(std::move(query));
  }
  int num_removed = 0;
  for (const std::string& scan : old) {
    if (stop.stop_requested()) break;
    num_removed += ForgetScan(scan) ? 1 : 0;
  }
  return num_removed;
}

/// Its digest goes first: what is removed on purpose is not missed.
void Store::ForgetRecording(const std::string& scan_id) {
  const std::unique_lock removals = LockRemovals();
  {
    const std::lock_guard lock(write_mutex_);
    Transaction transaction(*write_);
    write_->Prepare("DELETE FROM scan_files WHERE scan_id = ? AND path = 'recording'")
        .Bind(ParseId(scan_id))
        .Run();
    Write(store::kSelf, "recording.remove", scan_id, "quota");
    transaction.Commit();
  }
  std::error_code ignored;
  fs::remove_all(ScanFolder(scan_id) / kRecordingFolder, ignored);
}

int Store::KeepWithinQuota(std::uint64_t max_bytes, const std::stop_token& stop) {
  std::uint64_t bytes = BytesOf(folder_ / "scans", stop);
  if (bytes <= max_bytes) return 0;
  int num_touched = 0;
  std::vector<std::string> all, removable;
  {
    const std::lock_guard lock(write_mutex_);
    all = ScansOf(write_->Prepare("SELECT id FROM scans WHERE has_folder = 1 ORDER BY id"));
    removable =
        ScansOf(write_->Prepare("SELECT id FROM scans WHERE has_folder = 1 "
                                "AND id NOT IN (SELECT scan_id FROM refs) ORDER BY id"));
  }
  for (const std::string& scan : all) {  // raw recordings are large, and nothing hangs on them
    const fs::path recording = ScanFolder(scan) / kRecordingFolder;
    std::error_code ignored;
    if (bytes <= max_bytes || stop.stop_requested() || !fs::exists(recording, ignored)) continue;
    bytes -= std::min(bytes, BytesOf(recording, stop));
    ForgetRecording(scan);
    ++num_touched;
  }
  for (const std::string& scan : removable) {
    if (bytes <= max_bytes || stop.stop_requested()) break;
    const std::uint64_t its_bytes = BytesOf(ScanFolder(scan), stop);
    if (!ForgetScan(scan)) continue;  // a reference by now
    bytes -= std::min(bytes, its_bytes);
    ++num_touched;
  }
  return num_touched;
}

}  // namespace plumb
