// Removes scans and patients, on request and for their age or the space that they take.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <stop_token>
#include <string>

#include "daemon/records/scan_folders.hpp"
#include "daemon/records/scan_store.hpp"
#include "daemon/records/store_database.hpp"

namespace plumb {

/// Keeps removals and backups apart: nothing is removed while a backup is made.
class RemovalGate {
 public:
  /// Held while files are removed. @throws StoreRefusal while a backup is made.
  [[nodiscard]] std::unique_lock<std::mutex> LockRemovals();

  /// Exists while a backup is made. @throws StoreRefusal where one is being made already.
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

/// Thread-safe. Files go after the database's lock is free: a scan that begins meanwhile must not
/// wait for a slow disk. Throws StoreRefusal, and IoError and its kinds.
class StoreRemoval {
 public:
  /// All are borrowed; live longer.
  StoreRemoval(StoreDatabase& database, const ScanFolders& folders, const ScanStore& scans,
               RemovalGate& gate)
      : database_(database), folders_(folders), scans_(scans), gate_(gate) {}

  /// Removes all that is stored of a patient but the entries of the log.
  void WipePatient(const web::Actor& actor, const std::string& id);
  /// kConflict for a scan that references are made of, that runs, and while a backup is made;
  /// kInvalid without a reason.
  void RemoveScan(const web::Actor& actor, const std::string& id, const std::string& reason);
  /// Removes scans older than so many days (0: none) but those that references are made of. Gives
  /// how many. Their age is by the wall clock: call it while that can be trusted.
  int RemoveOldScans(int retention_days, const std::stop_token& stop = {});
  /// Removes the oldest recordings, then the oldest scans as above, until the scans take at most so
  /// many bytes. Gives how many scans lost something.
  int KeepWithinQuota(std::uint64_t max_bytes, const std::stop_token& stop = {});

 private:
  void RemoveFiles(const std::string& scan_id);
  void ForgetRecording(const std::string& scan_id);
  bool ForgetScan(const std::string& scan_id);  ///< False if it has become a reference.

  StoreDatabase& database_;
  const ScanFolders& folders_;
  const ScanStore& scans_;
  RemovalGate& gate_;
};

}  // namespace plumb
