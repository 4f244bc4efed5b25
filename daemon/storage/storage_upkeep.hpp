// SPDX-License-Identifier: Apache-2.0
// Upkeep of stored data, off the loop: retention and quota, checks of files and log, backups. Only
// backups begin during a scan.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/archive/backup.hpp"
#include "daemon/config/config.hpp"
#include "daemon/loop/clock_watch.hpp"
#include "daemon/storage/storage_watch.hpp"
#include "web/service/appliance_service.hpp"

namespace plumb {

/// Used on the loop's thread.
class StorageUpkeep {
 public:
  /// All arguments but `notify` are borrowed. The threads are destroyed before this object.
  /// @param notify  Notifies the page of changes.
  /// @param clock_trusted_after  Nothing is removed for its age until the wall clock has run for so
  ///         long without a step: a time server may still correct it.
  /// @param removal_rules  A file in the state folder can waive their `needs_backup`.
  StorageUpkeep(EventLoop& loop, StorageWatch& storage, const Config& config,
                std::function<void(web::EventKind)> notify,
                std::chrono::milliseconds clock_trusted_after, RemovalRules removal_rules,
                WorkThread& changes, WorkThread& reads);

  void StoreOpened(const Store& store);
  /// Does what is due; called at regular intervals.
  void Tick(bool is_running);
  /// Removes scans for their age or the quota, and checks the records.
  void Run();
  /// Once a scan has ended.
  void ScanEnded();
  void CheckDiskAtOnce();
  /// Stored data has changed.
  void RecountUnusable() { is_unusable_due_ = true; }
  /// Begins nothing more, and cuts short what is running.
  void Stop() { stop_.request_stop(); }

  /// Makes a backup while scans continue. Calls `done` on the loop with an error (empty if it was
  /// made) and the contents.
  /// @param recipients  Those for whom it is encrypted; none: the configured ones, if any.
  void BackUp(const Actor& actor, const std::filesystem::path& folder,
              std::function<void(const Message& error, const BackupReport& report)> done,
              AgeRecipients recipients = {});
  /// A person has noted that a backup was verified.
  void BackupVerified() { ticks_to_verification_ = 0; }
  /// Target of today's backup; empty if no folder is configured.
  [[nodiscard]] std::filesystem::path BackupTarget() const;

  /// What the page warns of. @param is_demo  The demo stores nothing of value.
  [[nodiscard]] std::vector<Message> Warnings(bool is_demo) const;
  /// The clock is far ahead of everything that is stored, as of the last look.
  [[nodiscard]] bool is_clock_doubted() const { return removals_.is_clock_doubted; }
  /// When the newest backup in the configured folder was made, as of the last look.
  [[nodiscard]] const std::optional<std::chrono::system_clock::time_point>& backup_made_at() const {
    return backup_made_at_;
  }

 private:
  static constexpr int kDiskCheckTicks = 10;  ///< While no scan runs, like the next two.
  static constexpr int kMaintenanceTicks = 3600;
  static constexpr int kFirstFileCheckTicks = 30;
  static constexpr int kBackupTicks = 60;  ///< Interval at which a due backup is checked for.
  static constexpr int kCheckpointTicks = 60, kNoteTicks = 3600;

  /// What the last removal found.
  struct RemovalFacts {
    int announced = 0, uncopied = 0;
    bool is_clock_doubted = false;
    std::string old_copies;  ///< Their names.
    bool operator==(const RemovalFacts&) const = default;
  };

  void RemoveScans();
  [[nodiscard]] RemovalFacts RemoveScansNow(std::optional<double> quota_gb, bool has_held,
                                            const std::stop_token& stop);
  void CheckBackups();
  void NoteLeap();
  void CheckRecords();
  void CheckStoredFiles();
  void CountUnusable();
  void BackUpIfDue();
  void AskForVerification();
  void EmptyLog();
  void NoteOutside();

  EventLoop& loop_;
  StorageWatch& storage_;
  const CurrentStore& store_;
  const Config& config_;
  const std::function<void(web::EventKind)> notify_;
  const std::chrono::milliseconds clock_trusted_after_;
  const RemovalRules removal_rules_;
  WorkThread& changes_;
  WorkThread& reads_;
  UnusableRecords unusable_;
  bool is_unusable_due_ = true;  ///< To be counted again.
  RemovalFacts removals_;
  std::map<std::filesystem::path, Message> backup_faults_;  ///< By the place of the backup.
  Message record_fault_;              ///< Set if the audit log has been altered.
  bool is_database_checked_ = false;  ///< By the start; the first check here can do without.
  std::int64_t lost_entries_ = 0;     ///< Of the audit log: the state folder was rolled back.
  Message backup_fault_, backup_unrehearsed_;
  std::optional<std::chrono::system_clock::time_point> backup_made_at_;
  /// Somebody with the key has to verify an encrypted backup.
  bool is_verification_due_ = false;
  bool backup_is_beside_scans_ = false;  ///< The last one to the configured folder.
  int ticks_to_disk_check_ = kDiskCheckTicks;
  int ticks_to_removal_ = kMaintenanceTicks;
  int ticks_to_file_check_ = kFirstFileCheckTicks;
  int ticks_to_backup_ = kBackupTicks;
  int ticks_to_record_check_ = 0;
  int ticks_to_checkpoint_ = kCheckpointTicks;
  int ticks_to_note_ = 0;
  int ticks_to_verification_ = 0;
  int ticks_to_backup_check_ = kFirstFileCheckTicks;
  ClockWatch clock_{std::chrono::system_clock::now(), std::chrono::steady_clock::now()};
  std::stop_source stop_;
};

}  // namespace plumb
