// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/file_integrity.hpp"

#include <algorithm>

#include "daemon/database/scan_digests.hpp"
#include "daemon/database/stored_values.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

constexpr const char* kScenePrefix = "scene/";
constexpr std::chrono::minutes kUnavailableAgain{10};

}  // namespace

Message FileIntegrity::Check(const std::string& scan_id, bool scene_only,
                             const std::stop_token& stop) {
  const std::int64_t scan = ParseId(scan_id).value_or(0);
  std::vector<FileDigest> files;
  bool is_done = false;
  {
    const StoreDatabase::Held writer = database_.ForChanges();
    const std::optional<std::string> outcome =
        writer->FirstText("SELECT outcome FROM scans WHERE id = ? AND has_folder = 1", scan);
    if (!outcome) return say::store::NoFiles();
    is_done = *outcome == "done";
    files = StoredDigests(*writer, scan);
  }
  const auto has = [&](const char* path) {
    return std::any_of(files.begin(), files.end(),
                       [&](const FileDigest& file) { return file.path == path; });
  };
  const std::filesystem::path folder = folders_.Scan(scan_id);
  std::vector<FileDigest> first_seen;
  Message fault;
  if (is_done && !has(kSceneMarker)) {  // stored by an older Plumb
    fault = WhyNotThere(folder, {{.path = kSceneMarker}}, look_);
    if (fault.empty()) first_seen = DigestsOfScan(folder, stop);
  } else {
    fault = WhyNotIntact(folder, files, scene_only ? kScenePrefix : "", stop);
  }
  if (!scene_only && fault.empty() && !has(kRecordingFolder)) {
    if (auto recording = DigestOfRecording(folder, stop)) first_seen.push_back(*recording);
  }
  StoreChange change(database_);
  const std::optional<std::string> before =
      change->FirstText("SELECT unavailable FROM scans WHERE id = ?", scan);
  if (!before) return say::store::RemovedMeanwhile();
  StoreDigests(*change, scan, first_seen);
  // An intact scene says nothing about the other files.
  if (!scene_only || !fault.empty()) SetUnavailable(*change, scan, *before, fault);
  if (!scene_only) {
    change->Run("UPDATE scans SET checked_at = ? WHERE id = ?", StoredNow(), scan);
  }
  change.Commit();
  return fault;
}

std::optional<CheckedScan> FileIntegrity::CheckNext(std::chrono::hours at_least,
                                                    const std::stop_token& stop) {
  const WallClock::time_point now = WallClock::now();
  // A time in the future is ignored, and files that were unavailable may be back.
  const std::optional<std::int64_t> next = database_.ForChanges()->FirstInteger(
      "SELECT id FROM scans WHERE has_folder = 1 AND (checked_at <= ?1 OR checked_at > ?2 OR "
      "(unavailable <> '' AND checked_at <= ?3)) ORDER BY checked_at, id LIMIT 1",
      ToStored(now - at_least), ToStored(now), ToStored(now - kUnavailableAgain));
  if (!next) return std::nullopt;
  std::string id = ScanId(*next);
  Message fault = Check(id, /*scene_only=*/false, stop);
  return CheckedScan{.id = std::move(id), .fault = std::move(fault)};
}

UnusableRecords FileIntegrity::CountUnusable() {
  const StoreDatabase::Held lists = database_.ForLists();
  const auto count = [&](const char* sql) {
    return static_cast<int>(lists->FirstInteger(sql).value_or(0));
  };
  UnusableRecords found;
  found.set_aside = static_cast<int>(folders_.SetAsideAs("").size());
  found.scans = count(
      "SELECT count(*) FROM scans JOIN patients ON patients.id = patient_id WHERE unavailable <> "
      "'' AND archived = 0");
  found.references = count(
      "SELECT count(*) FROM refs JOIN scans ON scans.id = scan_id JOIN patients ON patients.id = "
      "refs.patient_id WHERE unavailable <> '' AND archived = 0 AND version = (SELECT "
      "max(version) FROM refs AS r WHERE r.patient_id = refs.patient_id AND r.approved_by <> '')");
  return found;
}

}  // namespace plumb
