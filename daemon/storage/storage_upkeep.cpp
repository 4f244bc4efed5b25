// SPDX-License-Identifier: Apache-2.0
#include "daemon/storage/storage_upkeep.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/archive/backup_register.hpp"
#include "daemon/archive/store_backup.hpp"
#include "daemon/archive/summed_folder.hpp"
#include "daemon/database/clock_doubt.hpp"
#include "daemon/database/database.hpp"
#include "daemon/database/row_digests.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/loop/freed_memory.hpp"
#include "daemon/loop/give_way.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/state_folder/old_copies.hpp"
#include "daemon/state_folder/outside_note.hpp"
#include "daemon/state_folder/scan_numbers.hpp"
#include "words/backup.hpp"
#include "words/upkeep.hpp"

namespace plumb {

namespace {

/// Ticks between the checks of two stored scans, and until the next search for one that is due.
constexpr int kFileCheckTicks = 5, kNoFileCheckTicks = 600;
constexpr std::chrono::hours kFileCheckEvery{24};
/// A file in the state folder with which a person permits the removal of scans that no backup
/// holds.
constexpr const char* kRemoveWithoutBackup = "remove-without-backup";

bool AreOnOneDisk(const std::filesystem::path& a, const std::filesystem::path& b) {
  struct stat of_a {};
  struct stat of_b {};
  return ::stat(a.c_str(), &of_a) == 0 && ::stat(b.c_str(), &of_b) == 0 &&
         of_a.st_dev == of_b.st_dev;
}

}  // namespace

StorageUpkeep::StorageUpkeep(EventLoop& loop, StorageWatch& storage, const Config& config,
                             std::function<void(web::EventKind)> notify,
                             std::chrono::milliseconds clock_trusted_after,
                             RemovalRules removal_rules, WorkThread& changes, WorkThread& reads)
    : loop_(loop),
      storage_(storage),
      store_(storage.store()),
      config_(config),
      notify_(std::move(notify)),
      clock_trusted_after_(clock_trusted_after),
      removal_rules_(removal_rules),
      changes_(changes),
      reads_(reads) {}

void StorageUpkeep::StoreOpened(const Store& store) {
  is_database_checked_ = store.recovery().checked_database;
  is_unusable_due_ = true;
}

void StorageUpkeep::Tick(bool is_running) {
  if (is_unusable_due_) CountUnusable();
  if (clock_.Look(std::chrono::system_clock::now(), std::chrono::steady_clock::now()) > kLeap) {
    NoteLeap();
    ticks_to_removal_ = 0;  // or the page would say nothing of it for an hour
  }
  if (is_running) return;
  if (--ticks_to_disk_check_ <= 0) CheckDiskAtOnce();
  if (--ticks_to_removal_ <= 0) RemoveScans();
  if (--ticks_to_file_check_ <= 0) CheckStoredFiles();
  if (--ticks_to_backup_ <= 0) BackUpIfDue();
  if (--ticks_to_record_check_ <= 0) CheckRecords();
  if (--ticks_to_checkpoint_ <= 0) EmptyLog();
  if (--ticks_to_note_ <= 0) NoteOutside();
  if (--ticks_to_verification_ <= 0) AskForVerification();
  if (--ticks_to_backup_check_ <= 0) CheckBackups();
}

void StorageUpkeep::Run() {
  RemoveScans();
  CheckRecords();
}

void StorageUpkeep::ScanEnded() {
  // Its recording has no digest yet.
  ticks_to_file_check_ = std::min(ticks_to_file_check_, kFirstFileCheckTicks);
  NoteOutside();
  RemoveScans();
}

void StorageUpkeep::CheckDiskAtOnce() {
  ticks_to_disk_check_ = kDiskCheckTicks;
  storage_.CheckDisk();
}

/// For their age, or for the quota.
void StorageUpkeep::RemoveScans() {
  ticks_to_removal_ = kMaintenanceTicks;
  if (!storage_.IsUsable() || stop_.stop_requested()) return;
  const bool has_held = clock_.held() >= clock_trusted_after_;
  const std::optional<double> quota_gb = config_.appliance.quota_gb;
  const bool posted = changes_.Post([this, quota_gb, has_held, stop = stop_.get_token()] {
    RemovalFacts facts;
    try {
      if (const Message why = store_->WhyOtherScans(); !why.empty()) throw DiskRefused(why);
      facts = RemoveScansNow(quota_gb, has_held, stop);
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot remove old scans: {}", error.what()));
      return;
    }
    loop_.Post("removals", [this, facts] {
      if (facts == removals_) return;
      removals_ = facts;
      notify_(web::EventKind::kStatus);
    });
  });
  if (!posted) Log(LogLevel::kWarning, "the store is too busy to remove old scans now");
}

/// On the store's thread.
StorageUpkeep::RemovalFacts StorageUpkeep::RemoveScansNow(std::optional<double> quota_gb,
                                                          bool has_held,
                                                          const std::stop_token& stop) {
  std::error_code error;
  RemovalRules rules = removal_rules_;
  rules.needs_backup = !std::filesystem::exists(storage_.state() / kRemoveWithoutBackup, error);
  RemovalFacts facts;
  facts.is_clock_doubted = IsClockDoubted(*store_->database().ForChanges());
  if (facts.is_clock_doubted && storage_.IsClockKept()) {
    const StoreDatabase::Held writer = store_->database().ForChanges();
    Transaction transaction(*writer);
    TrustClock(*writer);
    transaction.Commit();
    facts.is_clock_doubted = false;
  }
  Removals old;
  if (has_held && !facts.is_clock_doubted)
    old = store_->removal.RemoveOldScans(store_->settings.Get().retention_days, rules, stop);
  const std::filesystem::space_info disk = storage_.SpaceOf(store_->folders.scans(), error);
  Removals over;
  if (quota_gb || !error)
    over = store_->removal.KeepWithinQuota(
        quota_gb ? static_cast<std::uint64_t>(*quota_gb * 1e9) : DefaultQuota(disk.capacity), rules,
        stop);
  if (old.removed + over.removed > 0)
    Log(LogLevel::kNotice,
        fmt::format("removed {} scans for their age, {} for the quota", old.removed, over.removed));
  facts.announced = old.announced + over.announced;
  facts.uncopied = std::max(old.uncopied, over.uncopied);
  for (const std::filesystem::path& copy : OldCopies(storage_.state()))
    facts.old_copies += (facts.old_copies.empty() ? "" : ", ") + copy.filename().string();
  return facts;
}

void StorageUpkeep::NoteLeap() {
  if (!storage_.IsUsable()) return;
  (void)changes_.Post([this] {
    try {
      DoubtClock(*store_->database().ForChanges());
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot note that the clock leapt: {}", error.what()));
    }
  });
}

/// Checks whether the bytes of the backups are still those that were written: only verified backups
/// permit the removal of scans.
void StorageUpkeep::CheckBackups() {
  ticks_to_backup_check_ = kNoFileCheckTicks;  // until this check has ended
  if (!storage_.IsUsable() || stop_.stop_requested()) return;
  (void)reads_.Post([this, stop = stop_.get_token(), folder = config_.appliance.backup_folder] {
    GiveWayToScans();
    std::optional<CheckedBackup> checked;
    try {
      checked = CheckNextBackup(store_->database(), kFileCheckEvery, stop);
    } catch (const Interrupted&) {
      return;
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot check the backups: {}", error.what()));
    }
    if (!checked) return;
    if (!checked->fault.empty())
      Log(LogLevel::kError,
          fmt::format("a backup is not as it was made: {}", checked->fault.English()));
    loop_.Post("backup check", [this, checked, folder] {
      ticks_to_backup_check_ = kFileCheckTicks;
      // A backup elsewhere, such as on a stick, may just be unplugged.
      if (folder.empty() || checked->place.parent_path() != folder) return;
      backup_faults_[checked->place] = checked->fault;
      notify_(web::EventKind::kStatus);
    });
  });
}

/// Verifies the audit log once a day, off the loop: its chain of digests protects nothing unless
/// it is checked.
void StorageUpkeep::CheckRecords() {
  constexpr int kDayTicks = 24 * 3600, kAgainTicks = 60;
  ticks_to_record_check_ = kDayTicks;
  if (!storage_.IsUsable()) return;
  const bool posted = reads_.Post([this] {
    Message fault;
    try {
      // The rows that are read come from the memory: only this notices later damage on the disk.
      if (!std::exchange(is_database_checked_, false)) {
        constexpr std::chrono::minutes kLongest{30};
        Database database(storage_.state() / kDatabaseFile, Database::Access::kFromDisk);
        UseRowKey(database, storage_.state());
        database.CheckIntegrity(kLongest);
        RequireAllRows(database);
      }
      if (const std::optional<std::int64_t> broken = store_->audit.FirstBroken())
        fault = say::upkeep::LogChanged(*broken);
      // The journal is stored separately: if somebody rewrites the whole log, its last digest no
      // longer matches the one that was noted here.
      if (const AuditHead head = store_->audit.Head(); fault.empty())
        Log(LogLevel::kInfo, fmt::format("the audit log is intact up to entry {}, chain {}",
                                         head.number, head.chain));
    } catch (const DatabaseCorrupt& error) {
      storage_.FailLater(error);
    } catch (const std::exception& error) {
      fault = say::upkeep::LogUnchecked(MessageOf(error));
    }
    loop_.Post("record check", [this, fault] {
      if (!fault.empty() && !(fault == record_fault_)) Log(LogLevel::kError, fault.English());
      record_fault_ = fault;
    });
  });
  if (!posted) ticks_to_record_check_ = kAgainTicks;
}

/// Empties the log of writes into the database. Only changes that decide something do so
/// themselves; others, such as logins, would stay in the log, and what is in the log alone can be
/// lost with it.
void StorageUpkeep::EmptyLog() {
  ticks_to_checkpoint_ = kCheckpointTicks;
  if (!storage_.IsUsable()) return;
  (void)changes_.Post([this] {
    std::error_code missing;
    const std::uintmax_t bytes = std::filesystem::file_size(
        storage_.state() / (std::string(kDatabaseFile) + "-wal"), missing);
    if (!missing && bytes > 0) (void)store_->database().ForChanges()->Checkpoint();
    // Images that come and go while nothing is scanned leave holes between what stays.
    ReturnFreedMemory();
  });
}

/// Compares the store with the note beside its backups, and renews the note. A note that proves a
/// rollback stays as it is; otherwise the rollback would be reported only once.
void StorageUpkeep::NoteOutside() {
  ticks_to_note_ = kNoteTicks;
  const std::filesystem::path folder = config_.appliance.backup_folder;
  if (folder.empty() || !storage_.IsUsable() || stop_.stop_requested()) return;
  (void)reads_.Post([this, folder] {
    std::int64_t lost = 0;
    try {
      const OutsideNote note = ReadOutsideNote(folder).value_or(OutsideNote{});
      NumberScansAbove(*store_->database().ForChanges(), note.last_scan);
      lost = LostEntries(*store_->database().ForLists(), note);
      if (lost == 0) {
        const OutsideNote renewed = Renewed(*store_->database().ForLists(), note);
        WriteOutsideNote(folder, renewed);  // no connection is held: the disk may be slow
      }
    } catch (const std::exception& error) {  // the disk may be missing, which the backup reports
      Log(LogLevel::kNotice,
          fmt::format("nothing is noted beside the backups now: {}", error.what()));
      return;
    }
    loop_.Post("outside note", [this, lost] {
      if (lost == lost_entries_) return;
      if (lost > 0)
        Log(LogLevel::kError,
            fmt::format("the state folder was rolled back: {} entries of its audit log are gone",
                        lost));
      lost_entries_ = lost;
      notify_(web::EventKind::kStatus);
    });
  });
}

/// One scan at a time, off the loop, and never while a scan runs: damaged files are noticed before
/// they are needed.
void StorageUpkeep::CheckStoredFiles() {
  ticks_to_file_check_ = kNoFileCheckTicks;  // until this check has ended
  if (!storage_.IsUsable() || stop_.stop_requested()) return;
  (void)reads_.Post([this, stop = stop_.get_token()] {
    std::optional<CheckedScan> checked;
    try {
      if (const Message why = store_->WhyOtherScans(); !why.empty()) throw DiskRefused(why);
      checked = store_->integrity.CheckNext(kFileCheckEvery, stop);
    } catch (const Interrupted&) {
      return;
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot check the stored scans: {}", error.what()));
    }
    if (checked) {
      loop_.Post("file check", [this, checked] {
        ticks_to_file_check_ = kFileCheckTicks;
        is_unusable_due_ = true;
        if (checked->fault.empty()) return;
        Log(LogLevel::kError,
            fmt::format("a stored scan has changed or is missing: {}", checked->fault.English()),
            {{"SCAN", checked->id}});
        notify_(web::EventKind::kData);
      });
    }
  });
}

/// Counts off the loop, because it goes through all scans.
void StorageUpkeep::CountUnusable() {
  if (!storage_.IsUsable()) return;
  is_unusable_due_ = !changes_.Post([this] {
    try {
      const UnusableRecords found = store_->integrity.CountUnusable();
      loop_.Post("unusable", [this, found] {
        if (found == unusable_) return;
        unusable_ = found;
        notify_(web::EventKind::kStatus);
      });
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot count unusable scans: {}", error.what()));
    }
  });
}

void StorageUpkeep::BackUp(
    const Actor& actor, const std::filesystem::path& folder,
    std::function<void(const Message& error, const BackupReport& report)> done,
    AgeRecipients recipients) {
  if (!storage_.IsUsable()) return done(say::upkeep::NoBackupInSafeMode(storage_.fault()), {});
  const ApplianceConfig& config = config_.appliance;
  if (recipients.empty()) recipients = config.backup_recipients;
  if (recipients.empty() && !config.backup_key_file.empty())  // never plain where it was encrypted
    return done(say::backup::NeedsRecipients(config.backup_key_file.string()), {});
  const bool posted =
      reads_.Post([this, actor, folder, done, recipients, stop = stop_.get_token()] {
        GiveWayToScans();
        BackupReport report;
        Message error;
        bool is_beside_scans = false;
        try {
          report = StoreBackup(*store_.get()).Make(actor, folder, stop, recipients);
          is_beside_scans = AreOnOneDisk(report.target, store_->folders.scans());
        } catch (const std::exception& failure) {
          error = MessageOf(failure);
        }
        Log(error.empty() ? LogLevel::kNotice : LogLevel::kError,
            error.empty()
                ? fmt::format("backup made: {}, {} scans, {} problems", report.target.string(),
                              report.scans, report.problems.size())
                : fmt::format("no backup was made in {}: {}", folder.string(), error.English()));
        loop_.Post("backup", [this, done, error, report, is_beside_scans, folder] {
          if (error.empty() && folder.parent_path() == BackupTarget().parent_path()) {
            backup_fault_ = {};
            backup_unrehearsed_ = report.unrehearsed;
            backup_is_beside_scans_ = is_beside_scans;
            backup_faults_.erase(report.target);
            NoteOutside();
          }
          ticks_to_backup_check_ = kFileCheckTicks;
          done(error, report);
        });
      });
  if (!posted) done(say::upkeep::TooManyTasks(), {});
}

/// One backup for each day of the week: the eighth replaces the first.
std::filesystem::path StorageUpkeep::BackupTarget() const {
  if (config_.appliance.backup_folder.empty()) return {};
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  return config_.appliance.backup_folder /
         fmt::format("plumb-{}", utc.tm_wday == 0 ? 7 : utc.tm_wday);
}

namespace {

/// When the newest backup in the folder was made.
std::optional<std::chrono::system_clock::time_point> NewestBackup(
    const std::filesystem::path& folder, const AgeRecipients& recipients) {
  using std::chrono::system_clock;
  std::optional<system_clock::time_point> newest;
  for (int day = 1; day <= 7; ++day) {
    std::error_code error;
    const std::filesystem::path plain = folder / fmt::format("plumb-{}", day);
    const auto made = std::filesystem::last_write_time(
        recipients.empty() ? plain / "backup.json" : EncryptedName(plain, recipients), error);
    if (error) continue;
    const auto at =
        std::chrono::time_point_cast<system_clock::duration>(std::chrono::file_clock::to_sys(made));
    // A time in the future does not count.
    if (at <= system_clock::now() && (!newest || at > *newest)) newest = at;
  }
  return newest;
}

}  // namespace

/// The disk for backups may be slow or missing, so the loop does not access it.
void StorageUpkeep::BackUpIfDue() {
  ticks_to_backup_ = kBackupTicks;
  const std::filesystem::path folder = config_.appliance.backup_folder;
  if (folder.empty() || !storage_.IsUsable() || stop_.stop_requested()) return;
  const std::chrono::duration<double> every =
      std::chrono::duration<double, std::ratio<3600>>(config_.appliance.backup_hours);
  (void)reads_.Post([this, folder, every, recipients = config_.appliance.backup_recipients] {
    const auto newest = NewestBackup(folder, recipients);
    const bool is_due = !newest || std::chrono::system_clock::now() - *newest >= every;
    loop_.Post("backup due", [this, newest, is_due] {
      backup_made_at_ = newest;
      if (!is_due) return;
      constexpr int kAgainTicks = 3600;  // a failed backup is not repeated at once
      ticks_to_backup_ = kAgainTicks;
      BackUp(kSelf, BackupTarget(), [this](const Message& error, const BackupReport&) {
        backup_fault_ = error;
        ticks_to_backup_ = error.empty() ? kBackupTicks : kAgainTicks;
      });
    });
  });
}

void StorageUpkeep::AskForVerification() {
  ticks_to_verification_ = kMaintenanceTicks;
  const ApplianceConfig& config = config_.appliance;
  const bool is_encrypted = !config.backup_folder.empty() && !config.backup_recipients.empty();
  if (!is_encrypted && std::exchange(is_verification_due_, false)) notify_(web::EventKind::kStatus);
  if (!is_encrypted || !storage_.IsUsable() || stop_.stop_requested()) return;
  (void)reads_.Post([this] {
    try {
      const bool is_due = IsVerificationDue(*store_->database().ForLists(), WallClock::now());
      loop_.Post("verification of backups", [this, is_due] {
        if (std::exchange(is_verification_due_, is_due) != is_due) notify_(web::EventKind::kStatus);
      });
    } catch (const std::exception& error) {
      Log(LogLevel::kError,
          fmt::format("cannot look when a backup was verified: {}", error.what()));
    }
  });
}

std::vector<Message> StorageUpkeep::Warnings(bool is_demo) const {
  std::vector<Message> warnings;
  if (storage_.IsNearlyFull())
    warnings.push_back(say::upkeep::NearlyFull(100 * storage_.UsedFraction()));
  if (unusable_.references > 0)
    warnings.push_back(say::upkeep::ReferencesUnusable(unusable_.references));
  if (unusable_.scans > 0) warnings.push_back(say::upkeep::ScansUnusable(unusable_.scans));
  if (unusable_.set_aside > 0) warnings.push_back(say::upkeep::ScansSetAside(unusable_.set_aside));
  if (!record_fault_.empty()) warnings.push_back(record_fault_);
  if (lost_entries_ > 0)
    warnings.push_back(say::upkeep::RolledBack(
        lost_entries_, (config_.appliance.backup_folder / kOutsideNote).string()));
  if (removals_.announced > 0)
    warnings.push_back(say::upkeep::RemovalsAnnounced(removals_.announced));
  if (removals_.uncopied > 0)
    warnings.push_back(say::upkeep::RemovalsWithoutCopy(
        removals_.uncopied, (storage_.state() / kRemoveWithoutBackup).string()));
  if (removals_.is_clock_doubted) warnings.push_back(say::upkeep::ClockDoubted());
  if (!removals_.old_copies.empty())
    warnings.push_back(say::upkeep::OldCopies(removals_.old_copies));
  if (config_.appliance.backup_folder.empty() && !is_demo)
    warnings.push_back(say::upkeep::NoBackup());
  if (!backup_fault_.empty()) warnings.push_back(say::upkeep::BackupFailed(backup_fault_));
  if (!backup_unrehearsed_.empty())
    warnings.push_back(say::upkeep::BackupNotRehearsed(backup_unrehearsed_));
  for (const auto& [place, fault] : backup_faults_) {
    if (!fault.empty()) warnings.push_back(say::upkeep::BackupNotAsMade(fault));
  }
  if (is_verification_due_) warnings.push_back(say::upkeep::VerificationDue());
  if (backup_is_beside_scans_)
    warnings.push_back(say::upkeep::BackupBesideScans(config_.appliance.backup_folder.string()));
  return warnings;
}

}  // namespace plumb
