// SPDX-License-Identifier: Apache-2.0
// Scans with files of known content, for tests of what the store keeps.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "daemon/records/store.hpp"
#include "drivers/files/file_io.hpp"

#include "tests/support/result_with.hpp"
namespace plumb::testing {

inline const Actor kAnna{.user = "anna", .address = "::1"};
inline const Actor kBert{.user = "bert", .address = "::1"};

/// Removals that wait for nothing.
inline constexpr RemovalRules kAtOnce{
    .needs_backup = false, .notice = std::chrono::seconds(0), .most_a_day = 1000};

/// What a compared scan leaves.
inline constexpr const char* kScanFiles[] = {
    "scene/scene.json", "scene/trajectory.txt", "scene/cloud.ply",     "scene/heightmap.tiff",
    "scene/mesh.ply",   "result/result.json",   "result/error_map.png"};

inline std::string ResultOfScan() { return ResultWith(R"({"verdict":"in_tolerance"})"); }

inline void FillScan(const std::filesystem::path& folder) {
  for (const std::string file : kScanFiles) {
    std::filesystem::create_directories((folder / file).parent_path());
    WriteWholeFile(folder / file, file == "result/result.json"
                                      ? ResultOfScan()
                                      : fmt::format("{} of {}", file, folder.string()));
  }
}

inline NewScan Begun(const std::string& patient) {
  return {.patient_id = patient, .reference_id = {}, .purpose = {}, .sensor_serial = "S1"};
}

/// @param fill  Writes the scan's files into a folder.
inline std::string StoreScan(
    Store& store, const std::string& patient,
    const std::function<void(const std::filesystem::path&)>& fill = FillScan) {
  const std::string id = store.scans.Begin(Begun(patient));
  const std::filesystem::path folder = store.folders.Staging(id);
  fill(folder);
  const auto result = ReadWholeFile(folder / "result/result.json", std::size_t{1} << 20);
  store.scans.Finish(id, {.outcome = ScanOutcome::kDone,
                          .result_json = std::string(result.begin(), result.end()),
                          .swept_area_m2 = 1.0});
  return id;
}

/// Anna plans a draft as it is, and Bert approves it.
inline std::string PlanAndApprove(Store& store, const std::string& draft) {
  (void)store.references.Plan(kAnna, draft, 1, store.references.Find(draft)->plan);
  store.references.Approve(kBert, draft, 2);
  return draft;
}

/// Path within the folder to content, of all regular files below it.
inline std::map<std::string, std::string> FilesBelow(const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;
  if (!std::filesystem::exists(folder)) return files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file() || entry.is_symlink()) continue;
    const auto bytes = ReadWholeFile(entry.path(), std::size_t{1} << 26);
    files[entry.path().lexically_relative(folder)] = std::string(bytes.begin(), bytes.end());
  }
  return files;
}

/// From this schema to that of 0.2.0, which stored English sentences only.
inline constexpr const char* kToSchema9 =
    "DROP TRIGGER scans_unavailable_message; ALTER TABLE scans DROP COLUMN failure_message; "
    "ALTER TABLE scans DROP COLUMN unavailable_message; ALTER TABLE refs DROP COLUMN "
    "approved_digest; ALTER TABLE refs DROP COLUMN source; ALTER TABLE refs DROP COLUMN "
    "patient_hash; ALTER TABLE sessions DROP COLUMN reference_id; ALTER TABLE sessions DROP "
    "COLUMN chosen_at_version; ALTER TABLE patients DROP COLUMN immobilisation; ALTER TABLE "
    "templates DROP COLUMN posture; ALTER TABLE templates DROP COLUMN hint; ALTER TABLE "
    "patients DROP COLUMN alert; ALTER TABLE patients DROP COLUMN photo; ALTER TABLE patients DROP "
    "COLUMN has_photo; ALTER TABLE patients DROP COLUMN drawing; ALTER TABLE patients DROP COLUMN "
    "sheet_revision; DROP TABLE "
    "backup_scans; DROP TABLE backups; DROP TABLE removals; DROP "
    "TABLE bin; DROP TABLE archived; DROP TABLE second_factors; DROP TABLE pins; DROP TABLE IF "
    "EXISTS row_digests; "
    "PRAGMA "
    "user_version = 9";

/// Turns a database into one of the schema of 0.2.0.
inline void MakeSchema9(const std::filesystem::path& database) {
  Database(database, Database::Access::kReadWrite).Execute(kToSchema9);
}

/// Turns a database into one of the schema of 0.1.0, without what that cannot hold.
inline void MakeSchema3(const std::filesystem::path& database) {
  MakeSchema9(database);
  Database(database, Database::Access::kReadWrite)
      .Execute(
          "DROP TABLE preferences; DROP TABLE room_calibrations; DROP TABLE templates; DROP TABLE "
          "removed_scans; DROP TABLE scan_files; DROP TABLE displays; DROP INDEX scans_of_session; "
          "ALTER TABLE scans DROP COLUMN session_id; ALTER TABLE scans DROP COLUMN "
          "accepted_reason; ALTER TABLE scans DROP COLUMN accepted_at; ALTER TABLE scans DROP "
          "COLUMN sensor_on_s; ALTER TABLE scans DROP COLUMN check_overdue; ALTER TABLE scans DROP "
          "COLUMN unavailable; ALTER TABLE scans DROP COLUMN checked_at; ALTER TABLE audit DROP "
          "COLUMN chain; ALTER TABLE patients DROP COLUMN note; ALTER TABLE patients DROP COLUMN "
          "archived; DROP TABLE sessions; DELETE FROM patients WHERE id = 0; DELETE FROM settings; "
          "PRAGMA user_version = 3");
}

}  // namespace plumb::testing
