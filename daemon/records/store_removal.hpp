// Removes scans and patients, on request or because of their age or the space that they take.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/records/scan_folders.hpp"
#include "daemon/records/scan_store.hpp"
#include "daemon/records/store_database.hpp"

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

/// Space that scans may take if no quota is set: 90 % of what other files leave on their disk.
[[nodiscard]] std::uint64_t DefaultQuota(std::uint64_t scan_bytes, std::uint64_t free_bytes);

/// Thread-safe. Files are removed after the database's lock is released: a scan that begins
/// meanwhile must not wait for a slow disk. Throws StoreRefusal, and IoError and its kinds.
class StoreRemoval {
 public:
  /// All are borrowed and outlive this object.
  StoreRemoval(StoreDatabase& database, const ScanFolders& folders, const ScanStore& scans,
               RemovalGate& gate)
      : database_(database), folders_(folders), scans_(scans), gate_(gate) {}

  /// Removes all stored data of a patient except the entries of the log.
  void WipePatient(const Actor& actor, const std::string& id);
  /// kConflict for a scan that references are made from, for a running scan, and while a backup is
  /// made; kInvalid without a reason.
  void RemoveScan(const Actor& actor, const std::string& id, const std::string& reason);
  /// Removes scans older than the given number of days (0: none) except those that references are
  /// made from, and those whose files cannot be seen now. Returns how many. Age is by the wall
  /// clock: call it only while that can be trusted.
  int RemoveOldScans(int retention_days, const std::stop_token& stop = {});
  /// Removes the oldest recordings, then the oldest scans as above, until the scans take at most
  /// the given number of bytes. Returns how many scans lost something.
  int KeepWithinQuota(std::uint64_t max_bytes, const std::stop_token& stop = {});
  struct Room {
    int num_removed = 0;  ///< Scans that lost something.
    /// False if the last removal freed nothing, for example because a backup or snapshot shares the
    /// blocks, or another program used the space at once. Then no more was removed.
    bool has_helped = true;
  };
  /// The same, with DefaultQuota() of the disk.
  /// @param free_bytes  Measures what is free on it; nothing where that cannot be measured: then
  ///         nothing is removed.
  Room KeepWithinRoom(const std::function<std::optional<std::uint64_t>()>& free_bytes,
                      const std::stop_token& stop = {});

 private:
  int RemoveOldest(std::uint64_t bytes, std::uint64_t max_bytes,
                   const std::function<bool()>& has_helped, const std::stop_token& stop);
  void LeaveOutOfSight(std::vector<std::string>& scan_ids);
  void RemoveFiles(const std::string& scan_id);
  void ForgetRecording(const std::string& scan_id);
  /// @param why  For the log. False if it has become a reference.
  bool ForgetScan(const std::string& scan_id, const char* why);

  StoreDatabase& database_;
  const ScanFolders& folders_;
  const ScanStore& scans_;
  RemovalGate& gate_;
};

}  // namespace plumb
