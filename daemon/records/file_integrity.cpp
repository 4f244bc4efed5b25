#include "daemon/records/file_integrity.hpp"

#include <algorithm>

#include "daemon/records/scan_digests.hpp"
#include "daemon/records/stored_values.hpp"

namespace plumb {

using store::Now;
using store::ParseId;
using store::ScanId;
using store::ToStored;

namespace {

constexpr const char* kScenePrefix = "scene/";
constexpr std::chrono::minutes kUnavailableAgain{10};

}  // namespace

std::string FileIntegrity::Check(const std::string& scan_id, bool scene_only,
                                 const std::stop_token& stop) {
  const std::int64_t scan = ParseId(scan_id).value_or(0);
  std::vector<FileDigest> files;
  bool is_done = false;
  {
    const StoreDatabase::Held writer = database_.ForChanges();
    Statement query = writer->Prepare("SELECT outcome FROM scans WHERE id = ? AND has_folder = 1");
    if (!query.Bind(scan).Step()) return "it has no files";
    is_done = query.Text(0) == "done";
    files = StoredDigests(*writer, scan);
  }
  const auto has = [&](const char* path) {
    return std::any_of(files.begin(), files.end(),
                       [&](const FileDigest& file) { return file.path == path; });
  };
  const std::filesystem::path folder = folders_.Scan(scan_id);
  std::vector<FileDigest> first_seen;
  std::string fault;
  if (is_done && !has(kSceneMarker)) {  // stored by an older Plumb
    fault = WhyNotThere(folder, {{.path = kSceneMarker, .sha256 = {}}}, look_);
    if (fault.empty()) first_seen = DigestsOfScan(folder, stop);
  } else {
    fault = WhyNotIntact(folder, files, scene_only ? kScenePrefix : "", stop);
  }
  if (!scene_only && fault.empty() && !has(kRecordingFolder)) {
    if (auto recording = DigestOfRecording(folder, stop)) first_seen.push_back(*recording);
  }
  StoreChange change(database_);
  std::string before;
  {
    Statement query = change.Prepare("SELECT unavailable FROM scans WHERE id = ?");
    if (!query.Bind(scan).Step()) return "it was removed meanwhile";
    before = query.Text(0);
  }
  StoreDigests(change.database(), scan, first_seen);
  // An intact scene says nothing about the other files.
  if (!scene_only || !fault.empty()) SetUnavailable(change.database(), scan, before, fault);
  if (!scene_only) {
    change.Prepare("UPDATE scans SET checked_at = ? WHERE id = ?").Bind(Now()).Bind(scan).Run();
  }
  change.Commit();
  return fault;
}

std::optional<CheckedScan> FileIntegrity::CheckNext(std::chrono::hours at_least,
                                                    const std::stop_token& stop) {
  std::string id;
  {
    const StoreDatabase::Held writer = database_.ForChanges();
    const WallClock::time_point now = WallClock::now();
    // A time in the future is ignored, and files that were unavailable may be back.
    Statement query = writer->Prepare(
        "SELECT id FROM scans WHERE has_folder = 1 AND (checked_at <= ?1 OR checked_at > ?2 OR "
        "(unavailable <> '' AND checked_at <= ?3)) ORDER BY checked_at, id LIMIT 1");
    query.Bind(ToStored(now - at_least))
        .Bind(ToStored(now))
        .Bind(ToStored(now - kUnavailableAgain));
    if (!query.Step()) return std::nullopt;
    id = ScanId(query.Integer(0));
  }
  std::string fault = Check(id, /*scene_only=*/false, stop);
  return CheckedScan{.id = std::move(id), .fault = std::move(fault)};
}

UnusableRecords FileIntegrity::CountUnusable() {
  const StoreDatabase::Held lists = database_.ForLists();
  UnusableRecords found;
  found.set_aside = static_cast<int>(folders_.SetAsideAs("").size());
  {
    Statement query = lists->Prepare(
        "SELECT count(*) FROM scans JOIN patients ON patients.id = patient_id WHERE unavailable <> "
        "'' AND archived = 0");
    if (query.Step()) found.scans = static_cast<int>(query.Integer(0));
  }
  Statement query = lists->Prepare(
      "SELECT count(*) FROM refs JOIN scans ON scans.id = scan_id JOIN patients ON patients.id = "
      "refs.patient_id WHERE unavailable <> '' AND archived = 0 AND version = (SELECT "
      "max(version) FROM refs AS r WHERE r.patient_id = refs.patient_id AND r.approved_by <> '')");
  if (query.Step()) found.references = static_cast<int>(query.Integer(0));
  return found;
}

}  // namespace plumb
