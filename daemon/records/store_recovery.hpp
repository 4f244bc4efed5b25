// What a start finds after a crash, and puts right.
#pragma once

#include <memory>

#include "daemon/records/database.hpp"
#include "daemon/records/scan_files.hpp"
#include "daemon/records/scan_folders.hpp"

namespace plumb {

/// Most of the stored scans cannot be seen: supposedly their disk is not mounted. Nothing was
/// changed.
class ScansMissing : public DiskRefused {
 public:
  using DiskRefused::DiskRefused;
};

/// Each step is in the audit log too.
struct RecoveryReport {
  int interrupted_scans = 0;     ///< Had begun and not ended: failed now.
  int orphaned_folders = 0;      ///< Staging, or of scans that failed or were removed: removed.
  int foreign_folders = 0;       ///< Of scans that no row records as ended; moved to set-aside.
  int lost_scans = 0;            ///< Finished, but their files cannot be seen now: unavailable.
  int attached_scans = 0;        ///< Were unavailable, and their files are there again.
  int broken_references = 0;     ///< Approved, but their scene cannot be seen: to be shown loudly.
  bool checked_database = true;  ///< False: there was not time to look at all of it.
};

/// A database that was lost must not pass for a new one: every scan would be an orphan.
/// @throws DatabaseCorrupt where the database is new and there are scans.
void RefuseScansOfAnother(Database& database, const ScanFolders& folders);

/// Fails scans that were interrupted, notes which files are there, removes what a crash or a
/// removal left, and moves folders that belong to no row to set-aside. The caller holds the
/// connection for changes.
/// @throws ScansMissing; IoError and its kinds
void RecoverStore(Database& database, const ScanFolders& folders, const LookAtPath& look,
                  RecoveryReport& report);

}  // namespace plumb
