// SPDX-License-Identifier: Apache-2.0
// Recovery of the store at a start after a crash.
#pragma once

#include "daemon/database/database.hpp"
#include "daemon/database/scan_folders.hpp"
#include "daemon/scan_files/scan_files.hpp"

namespace plumb {

/// Most of the stored scans cannot be found, or the folder of the scans is empty; probably their
/// disk is not mounted. Nothing was changed.
class ScansMissing : public DiskRefused {
 public:
  using DiskRefused::DiskRefused;
};

/// Each step is in the audit log too.
struct RecoveryReport {
  int interrupted_scans = 0;  ///< Had begun and not ended; marked as failed.
  /// Staging folders, or folders of scans that failed or were removed; deleted.
  int orphaned_folders = 0;
  int foreign_folders = 0;  ///< Folders of scans that no row records as ended; moved to set-aside.
  int lost_scans = 0;       ///< Finished, but their files cannot be found; marked unavailable.
  /// Were unavailable or set aside, and their files are there again.
  int attached_scans = 0;
  /// Approved, but their scene cannot be found; to be shown prominently.
  int broken_references = 0;
  bool checked_database = true;  ///< False: there was not enough time to check all of it.
};

/// A lost database must not be replaced by a new one, to which every scan would be an orphan.
/// @throws DatabaseCorrupt if the database is new and there are or were scans, or a restore was
/// interrupted.
void RefuseScansOfAnother(Database& database, const ScanFolders& folders);

/// Confirms to the next start that this number of missing scans is lost for good. They are marked
/// unavailable then, and nothing is deleted. Another number is not confirmed by it.
/// @throws IoError
void ConfirmLostScans(const std::filesystem::path& state, int num_lost);

/// Fails scans that were interrupted, records which files exist, removes the remains of a crash or
/// a removal, moves folders without a row to set-aside, and moves them back once there is a row
/// whose digests they match. The caller holds the connection for
/// changes.
/// @throws ScansMissing; IoError and its kinds
void RecoverStore(Database& database, const ScanFolders& folders, const ExaminePath& look,
                  RecoveryReport& report);

}  // namespace plumb
