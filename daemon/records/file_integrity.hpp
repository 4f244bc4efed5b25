// SPDX-License-Identifier: Apache-2.0
// Checks that the files of the scans are still as they were stored.
#pragma once

#include <chrono>
#include <optional>
#include <stop_token>
#include <string>

#include "algo/base/message.hpp"
#include "daemon/database/scan_folders.hpp"
#include "daemon/database/store_database.hpp"
#include "daemon/scan_files/scan_files.hpp"

namespace plumb {

struct CheckedScan {
  std::string id;
  Message fault;  ///< Empty if its files are as they were stored.
};

/// What cannot be used because of its files, of patients who are not archived.
struct UnusableRecords {
  int scans = 0;
  int references = 0;  ///< Patients whose newest approved reference is one of them.
  int set_aside = 0;   ///< Folders of scans that the database does not know; of any patient.
  bool operator==(const UnusableRecords&) const = default;
};

/// Thread-safe. @throws IoError and its kinds; Interrupted
class FileIntegrity {
 public:
  /// Database and folders are borrowed and outlive this object.
  FileIntegrity(StoreDatabase& database, const ScanFolders& folders, ExaminePath look)
      : database_(database), folders_(folders), look_(std::move(look)) {}

  /// Why the files of a scan cannot be used, by their SHA-256: "scene/cloud.ply has been changed
  /// ...". Empty if they are as they were stored. Files without a digest get one ("first seen").
  /// Updates the scan's row and the log if the result has changed.
  /// @param scene_only  Only the files that a comparison reads.
  [[nodiscard]] Message Check(const std::string& scan_id, bool scene_only,
                              const std::stop_token& stop = {});
  /// Checks the scan whose last check is the oldest, if it is longer ago than `at_least`. Nothing
  /// if none is due.
  std::optional<CheckedScan> CheckNext(std::chrono::hours at_least,
                                       const std::stop_token& stop = {});
  /// As found by the last check of each scan.
  [[nodiscard]] UnusableRecords CountUnusable();

 private:
  StoreDatabase& database_;
  const ScanFolders& folders_;
  ExaminePath look_;
};

}  // namespace plumb
