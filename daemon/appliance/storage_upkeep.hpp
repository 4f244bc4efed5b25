// Upkeep of stored data, off the loop: retention and quota, checks of files and log, backups. Only
// backups begin during a scan.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/appliance/storage_watch.hpp"
#include "daemon/config/config.hpp"
#include "daemon/loop/clock_watch.hpp"
#include "web/service/appliance_service.hpp"

namespace plumb {

/// Used on the loop's thread.
class StorageUpkeep {
 public:
  /// All arguments but `notify` are borrowed. The threads are destroyed before this object.
  /// @param notify  Notifies the page of changes.
  /// @param clock_trusted_after  Nothing is removed for its age until the wall clock has run for so
  ///         long without a step: a time server may still correct it.
  StorageUpkeep(EventLoop& loop, StorageWatch& storage, const Config& config,
                std::function<void(web::EventKind)> notify,
                std::chrono::milliseconds clock_trusted_after, WorkThread& changes,
                WorkThread& reads);

  void StoreOpened(const Store& store);
  /// Does what is due; called at regular intervals.
  void Tick(bool is_running);
  /// Removes scans for their age or the quota, and checks the records.
  void Run();
  /// Once a scan has ended.
  void ScanEnded();
  void CheckDiskAtOnce();
  /// Stored data has changed.
  void CountAgain() { is_unusable_due_ = true; }
  /// Begins nothing more, and cuts short what is running.
  void Stop() { stop_.request_stop(); }

  /// Makes a backup while scans continue. Calls `done` on the loop with an error (empty if it was
  /// made) and the contents.
  /// @param key_file  Key for encryption; empty: the configured one, if any.
  void BackUp(const Actor& actor, const std::filesystem::path& folder,
              std::function<void(const std::string& error, const BackupReport& report)> done,
              const std::filesystem::path& key_file = {});
  /// Target of today's backup; empty if no folder is configured.
  [[nodiscard]] std::filesystem::path BackupTarget() const;

  /// What the page warns of. @param is_demo  The demo stores nothing of value.
  [[nodiscard]] std::vector<std::string> Warnings(bool is_demo) const;

 private:
  static constexpr int kDiskCheckTicks = 10;  ///< While no scan runs, like the next two.
  static constexpr int kMaintenanceTicks = 3600;
  static constexpr int kFirstFileCheckTicks = 30;
  static constexpr int kBackupTicks = 60;  ///< Interval at which a due backup is checked for.

  void RemoveScans();
  [[nodiscard]] int KeepWithinRoom(const std::stop_token& stop);
  void CheckRecords();
  void CheckStoredFiles();
  void CountUnusable();
  void BackUpIfDue();

  EventLoop& loop_;
  StorageWatch& storage_;
  const CurrentStore& store_;
  const Config& config_;
  const std::function<void(web::EventKind)> notify_;
  const std::chrono::milliseconds clock_trusted_after_;
  WorkThread& changes_;
  WorkThread& reads_;
  UnusableRecords unusable_;
  bool is_unusable_due_ = true;       ///< To be counted again.
  bool is_quota_useful_ = true;       ///< Removals have freed space; for the store's thread.
  std::string record_fault_;          ///< That the audit log is not as it was written.
  bool is_database_checked_ = false;  ///< Once it is open, the check thread's.
  std::string backup_fault_;
  bool backup_is_beside_scans_ = false;  ///< The last one to the configured folder.
  int ticks_to_disk_check_ = kDiskCheckTicks;
  int ticks_to_removal_ = kMaintenanceTicks;
  int ticks_to_file_check_ = kFirstFileCheckTicks;
  int ticks_to_backup_ = kBackupTicks;
  int ticks_to_record_check_ = 0;
  ClockWatch clock_{std::chrono::system_clock::now(), std::chrono::steady_clock::now()};
  std::stop_source stop_;
};

}  // namespace plumb
