// SPDX-License-Identifier: Apache-2.0
// Removes scans and patients, on request or because of their age or the space that they take.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/database/scan_folders.hpp"
#include "daemon/database/store_database.hpp"
#include "daemon/records/scan_store.hpp"

namespace plumb {

/// Excludes removals and backups from each other: nothing is removed while a backup is made.
class RemovalGate {
 public:
  /// Held while files are removed. @throws StoreRefusal while a backup is made.
  [[nodiscard]] std::unique_lock<std::mutex> LockRemovals();

  /// Exists while a backup is made. @throws StoreRefusal if one is being made already.
  class Backup {
   public:
    explicit Backup(RemovalGate& gate);
    ~Backup() { gate_.backing_up_ = false; }
    Backup(const Backup&) = delete;
    Backup& operator=(const Backup&) = delete;

   private:
    RemovalGate& gate_;
  };

 private:
  std::mutex mutex_;
  std::atomic<bool> backing_up_ = false;
};

/// Space that scans may take if no quota is set: 90 % of their disk, however much other programs
/// store there.
[[nodiscard]] std::uint64_t DefaultQuota(std::uint64_t disk_bytes);

/// Limits of automatic removal: each scan needs another copy and a notice in advance,
/// and only a few go at a time.
struct RemovalRules {
  bool needs_backup = true;  ///< Only scans in a verified backup (backup_register.hpp).
  std::chrono::seconds notice = std::chrono::hours(24);  ///< From announcement to removal.
  /// Most removals in 24 hours; or twice the mean daily number of scans in the last seven days, if
  /// that is more.
  int most_a_day = 5;
};

struct Removals {
  int removed = 0;    ///< Scans that lost something.
  int announced = 0;  ///< Scans that will lose something, unless they become references or
                      ///< room is made.
  int uncopied = 0;   ///< Scans that would have to go, but no verified backup holds them.
};

/// Thread-safe. Files are removed after the database's lock is released: a scan that begins
/// meanwhile must not wait for a slow disk. Throws StoreRefusal, and IoError and its kinds.
class StoreRemoval {
 public:
  /// All are borrowed and outlive this object.
  StoreRemoval(StoreDatabase& database, const ScanFolders& folders, const ScanStore& scans,
               RemovalGate& gate)
      : database_(database), folders_(folders), scans_(scans), gate_(gate) {}

  /// Removes all stored data of a patient except the entries of the log, also from the bin and from
  /// old copies of the store (old_copies.hpp).
  void WipePatient(const Actor& actor, const std::string& id);
  /// Moves the files to the bin. kConflict for a scan that references are made from, for a running
  /// scan, and while a backup is made; kInvalid without a reason.
  void RemoveScan(const Actor& actor, const std::string& id, const std::string& reason);
  /// Moves to the bin scans older than the given number of days (0: none) except those that
  /// references are made from, and those whose files cannot be seen now; empties the bin of what
  /// has been there for kTimeInBin. Age is by the wall clock: call it only while that can be
  /// trusted.
  Removals RemoveOldScans(int retention_days, const RemovalRules& rules = {},
                          const std::stop_token& stop = {});
  /// Removes what is in the bin, then the oldest recordings, then the oldest scans as above,
  /// accepted ones last, until the scans take at most the given number of bytes.
  Removals KeepWithinQuota(std::uint64_t max_bytes, const RemovalRules& rules = {},
                           const std::stop_token& stop = {});

 private:
  void LeaveOutOfSight(std::vector<std::string>& scan_ids);
  void LeaveUncopied(std::vector<std::string>& scan_ids, const RemovalRules& rules, Removals& done);
  [[nodiscard]] std::vector<std::string> Due(const std::vector<std::string>& scan_ids,
                                             const char* kind, const RemovalRules& rules,
                                             Removals& done);
  std::uint64_t EmptyBin(std::uint64_t bytes, std::uint64_t max_bytes, const std::stop_token& stop);
  void RemoveFiles(const std::string& scan_id);
  void ForgetRecording(const std::string& scan_id);
  /// @param why  For the log. False if it has become a reference.
  bool ForgetScan(const std::string& scan_id, const Message& why, bool to_bin);

  StoreDatabase& database_;
  const ScanFolders& folders_;
  const ScanStore& scans_;
  RemovalGate& gate_;
};

}  // namespace plumb
