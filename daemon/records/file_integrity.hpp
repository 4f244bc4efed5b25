// Whether the files of the scans are still what was stored.
#pragma once

#include <chrono>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/records/scan_files.hpp"
#include "daemon/records/scan_folders.hpp"
#include "daemon/records/store_database.hpp"

namespace plumb {

struct CheckedScan {
  std::string id;
  std::string fault;  ///< Empty: its files are what was stored.
};

/// Thread-safe. @throws IoError and its kinds; Interrupted
class FileIntegrity {
 public:
  /// Database and folders are borrowed; live longer.
  FileIntegrity(StoreDatabase& database, const ScanFolders& folders, LookAtPath look)
      : database_(database), folders_(folders), look_(std::move(look)) {}

  /// Why the files of a scan cannot be used, by their SHA-256: "scene/cloud.ply has been changed
  /// ...". Empty: they are what was stored. Files that have no digest yet get one ("first seen").
  /// Changes the scan's row and the log where that is news.
  /// @param scene_only  Only what a comparison reads.
  [[nodiscard]] std::string Check(const std::string& scan_id, bool scene_only,
                                  const std::stop_token& stop = {});
  /// Checks the scan that was not checked for longest, if that is longer ago than `at_least`.
  /// Nothing if none is due.
  std::optional<CheckedScan> CheckNext(std::chrono::hours at_least,
                                       const std::stop_token& stop = {});

 private:
  StoreDatabase& database_;
  const ScanFolders& folders_;
  LookAtPath look_;
};

}  // namespace plumb
