// SPDX-License-Identifier: Apache-2.0
// The scans: how they begin, end and are accepted. StoreRemoval removes them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/database/scan_folders.hpp"
#include "daemon/database/store_database.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "web/model/account.hpp"
#include "web/model/check.hpp"
#include "web/model/scan.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

/// Data at the beginning of a scan.
struct NewScan {
  std::string patient_id;
  std::string reference_id;  ///< Empty without a reference.
  ScanPurpose purpose = ScanPurpose::kFraction;
  std::string sensor_serial;
  std::string reason = {};      ///< Reason for a new reference.
  std::string session_id = {};  ///< Empty without an open session.
  std::optional<double> sensor_on_s = {};
  DailyCheck daily_check = DailyCheck::kPassed;
};

/// Outcome of a scan.
struct FinishedScan {
  ScanOutcome outcome = ScanOutcome::kFailed;
  Message failure = {};
  std::string result_json = {};  ///< Empty if nothing was compared.
  double swept_area_m2 = 0.0;
};

/// Ends the scans that have begun and not ended, as interrupted. Within a transaction.
void FailInterruptedScans(Database& database);

/// A scan's files are written to a hidden staging folder and appear under their id in one step; its
/// row says `done` only afterwards, so that a crash at any point leaves either a complete scan or
/// none.
///
/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class ScanStore {
 public:
  /// Both are borrowed and outlive this object.
  ScanStore(StoreDatabase& database, const ScanFolders& folders)
      : database_(database), folders_(folders) {}

  /// Newest first; a scan that cannot be read is listed as failed, with that reason.
  /// @param patient_id  Empty: all patients.
  [[nodiscard]] std::vector<Scan> List(const std::string& patient_id, int limit);
  /// @throws DataError if it cannot be read
  [[nodiscard]] std::optional<Scan> Find(const std::string& id);
  /// Completed scans of a patient.
  [[nodiscard]] int CountSince(const std::string& patient_id, WallClock::time_point since);
  /// The newest scan that was stored with files.
  [[nodiscard]] std::optional<std::string> NewestWithFiles();
  /// Surface seen by a scan's sweep; 0 if unknown.
  [[nodiscard]] double SweptArea(const std::string& scan_id);

  /// Stores a row with the outcome `running`, and creates an empty staging folder. Returns the id.
  std::string Begin(const NewScan& scan);
  /// kDone: the staging folder becomes the scan's. kFailed: only its recording is kept, if
  /// complete. Otherwise it is removed.
  void Finish(const std::string& scan_id, const FinishedScan& finished);
  /// Stores a scene that no sensor took, as the done scan of a reference.
  /// @param made  A staging folder with the scene, which becomes the scan's. Returns the id.
  std::string AddMade(const NewScan& scan, const std::filesystem::path& made);
  /// A file that a finished scan has got since: from now on it is one of those that must stay as
  /// they are. Nothing for a scan that was removed meanwhile.
  /// @param path  In the scan's folder.
  void AddFile(const std::string& scan_id, const std::string& path);
  /// Verdict, numbers and reason are logged. kConflict if a newer scan of the patient is done or
  /// running, and for a result that is not in tolerance without a reason.
  void Accept(const Actor& actor, const std::string& id, const std::string& reason = {});

  /// Results that were accepted since then and are in no archive, oldest first.
  [[nodiscard]] std::vector<std::string> ToArchive(WallClock::time_point since);
  /// The archive has stored the result; logged.
  void NoteArchived(const std::string& id, const std::string& archive);

  /// The scan that has begun and not ended. Stable while the caller holds the connection for
  /// changes.
  [[nodiscard]] std::optional<std::int64_t> running() const { return running_; }

 private:
  Scan ReadScan(const Statement& row) const;
  Scan ListScan(const Statement& row) const;
  static void NoteEnd(Database& database, const std::string& scan_id, const FinishedScan& finished,
                      bool has_folder, const std::vector<FileDigest>& files);

  StoreDatabase& database_;
  const ScanFolders& folders_;
  std::optional<std::int64_t> running_;  ///< Guarded by the connection for changes.
};

}  // namespace plumb
