#include "daemon/appliance/storage_upkeep.hpp"

#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/records/database.hpp"
#include "daemon/records/file_cipher.hpp"
#include "daemon/records/stored_values.hpp"

namespace plumb {

namespace {

/// Ticks between the checks of two stored scans, and until the next search for one that is due.
constexpr int kFileCheckTicks = 5, kNoFileCheckTicks = 600;
constexpr std::chrono::hours kFileCheckEvery{24};

bool AreOnOneDisk(const std::filesystem::path& a, const std::filesystem::path& b) {
  struct stat of_a {};
  struct stat of_b {};
  return ::stat(a.c_str(), &of_a) == 0 && ::stat(b.c_str(), &of_b) == 0 &&
         of_a.st_dev == of_b.st_dev;
}

}  // namespace

StorageUpkeep::StorageUpkeep(EventLoop& loop, StorageWatch& storage, const Config& config,
                             std::function<void(web::EventKind)> notify,
                             std::chrono::milliseconds clock_trusted_after, WorkThread& changes,
                             WorkThread& reads)
    : loop_(loop),
      storage_(storage),
      store_(storage.store()),
      config_(config),
      notify_(std::move(notify)),
      clock_trusted_after_(clock_trusted_after),
      changes_(changes),
      reads_(reads) {}

void StorageUpkeep::StoreOpened(const Store& store) {
  is_database_checked_ = store.recovery().checked_database;
  is_unusable_due_ = true;
}

void StorageUpkeep::Tick(bool is_running) {
  if (is_unusable_due_) CountUnusable();
  clock_.Look(std::chrono::system_clock::now(), std::chrono::steady_clock::now());
  if (is_running) return;
  if (--ticks_to_disk_check_ <= 0) CheckDiskAtOnce();
  if (--ticks_to_removal_ <= 0) RemoveScans();
  if (--ticks_to_file_check_ <= 0) CheckStoredFiles();
  if (--ticks_to_backup_ <= 0) BackUpIfDue();
  if (--ticks_to_record_check_ <= 0) CheckRecords();
}

void StorageUpkeep::Run() {
  RemoveScans();
  CheckRecords();
}

void StorageUpkeep::ScanEnded() {
  // Its recording has no digest yet.
  ticks_to_file_check_ = std::min(ticks_to_file_check_, kFirstFileCheckTicks);
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
  const bool has_clock = clock_.held() >= clock_trusted_after_;
  const std::optional<double> quota_gb = config_.appliance.quota_gb;
  const bool posted = changes_.Post([this, quota_gb, has_clock, stop = stop_.get_token()] {
    try {
      if (const std::string why = store_->WhyOtherScans(); !why.empty()) throw DiskRefused(why);
      const int old =
          has_clock ? store_->removal.RemoveOldScans(store_->settings.Get().retention_days, stop)
                    : 0;
      const int over = quota_gb ? store_->removal.KeepWithinQuota(
                                      static_cast<std::uint64_t>(*quota_gb * 1e9), stop)
                                : KeepWithinRoom(stop);
      if (old + over > 0)
        Log(LogLevel::kNotice,
            fmt::format("removed {} scans for their age, {} for the quota", old, over));
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot remove old scans: {}", error.what()));
    }
  });
  if (!posted) Log(LogLevel::kWarning, "the store is too busy to remove old scans now");
}

/// Without a configured quota; on the store's thread. Once a removal has freed nothing, no further
/// one is tried: each would cost another scan.
int StorageUpkeep::KeepWithinRoom(const std::stop_token& stop) {
  if (!is_quota_useful_) return 0;
  const auto free_bytes = [this]() -> std::optional<std::uint64_t> {
    std::error_code error;
    const std::filesystem::space_info space = storage_.SpaceOf(store_->folders.scans(), error);
    return error ? std::nullopt : std::optional<std::uint64_t>(space.available);
  };
  const StoreRemoval::Room room = store_->removal.KeepWithinRoom(free_bytes, stop);
  is_quota_useful_ = room.has_helped;
  if (!is_quota_useful_)
    Log(LogLevel::kError,
        "the disk is nearly full, and removing an old scan freed nothing: a backup on the same "
        "disk may hold its files, or another program fills the disk. No more scans are removed "
        "for the quota until the next start");
  return room.num_removed;
}

/// Verifies the audit log once a day, off the loop: its chain of digests protects nothing unless
/// it is checked.
void StorageUpkeep::CheckRecords() {
  constexpr int kDayTicks = 24 * 3600, kAgainTicks = 60;
  ticks_to_record_check_ = kDayTicks;
  if (!storage_.IsUsable()) return;
  const bool posted = reads_.Post([this] {
    std::string fault;
    try {
      if (!std::exchange(is_database_checked_, true)) {
        constexpr std::chrono::minutes kLongest{30};
        Database(storage_.state() / kDatabaseFile, Database::Access::kReadOnly)
            .CheckIntegrity(kLongest);
      }
      if (const std::optional<std::int64_t> broken = store_->audit.FirstBroken())
        fault = fmt::format(
            "The audit log has been changed or shortened from outside: entry {} is not as it was "
            "written. Compare it with a backup",
            *broken);
      // The journal is stored separately: if somebody rewrites the whole log, its last digest no
      // longer matches the one that was noted here.
      if (const AuditHead head = store_->audit.Head(); fault.empty())
        Log(LogLevel::kInfo, fmt::format("the audit log is intact up to entry {}, chain {}",
                                         head.number, head.chain));
    } catch (const DatabaseCorrupt& error) {
      storage_.FailLater(error);
    } catch (const std::exception& error) {
      fault = fmt::format("The audit log cannot be checked: {}", error.what());
    }
    loop_.Post("record check", [this, fault] {
      if (!fault.empty() && fault != record_fault_) Log(LogLevel::kError, fault);
      record_fault_ = fault;
    });
  });
  if (!posted) ticks_to_record_check_ = kAgainTicks;
}

/// One scan at a time, off the loop, and never while a scan runs: damaged files are noticed before
/// they are needed.
void StorageUpkeep::CheckStoredFiles() {
  ticks_to_file_check_ = kNoFileCheckTicks;  // until this check has ended
  if (!storage_.IsUsable() || stop_.stop_requested()) return;
  (void)reads_.Post([this, stop = stop_.get_token()] {
    std::optional<CheckedScan> checked;
    try {
      if (const std::string why = store_->WhyOtherScans(); !why.empty()) throw DiskRefused(why);
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
            fmt::format("a stored scan has changed or is missing: {}", checked->fault),
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

namespace {

/// From now on the calling thread gets processor and disk time only when they are idle, so that a
/// backup costs no frames of a scan. If the system refuses, the priority stays unchanged.
void GiveWayToScans() {
  constexpr int kLeastPriority = 19, kOfThread = 1, kBestEffort = 2, kLowestOfIts = 7;
  (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kLeastPriority);
  (void)::syscall(SYS_ioprio_set, kOfThread, 0, kBestEffort << 13 | kLowestOfIts);
}

}  // namespace

void StorageUpkeep::BackUp(
    const Actor& actor, const std::filesystem::path& folder,
    std::function<void(const std::string& error, const BackupReport& report)> done,
    const std::filesystem::path& key_file) {
  if (!storage_.IsUsable())
    return done("nothing can be backed up in safe mode: " + storage_.fault(), {});
  const std::filesystem::path key = key_file.empty() ? config_.appliance.backup_key_file : key_file;
  const bool posted = reads_.Post([this, actor, folder, done, key, stop = stop_.get_token()] {
    GiveWayToScans();
    BackupReport report;
    std::string error;
    bool is_beside_scans = false;
    try {
      std::optional<BackupSecret> secret;
      if (!key.empty()) secret.emplace(key);
      report = store_->backup.Make(actor, folder, stop, secret ? &*secret : nullptr);
      is_beside_scans = AreOnOneDisk(folder, store_->folders.scans());
    } catch (const std::exception& failure) {
      error = failure.what();
    }
    Log(error.empty() ? LogLevel::kNotice : LogLevel::kError,
        error.empty() ? fmt::format("backup made: {}, {} scans, {} problems", folder.string(),
                                    report.scans, report.problems.size())
                      : fmt::format("no backup was made in {}: {}", folder.string(), error));
    loop_.Post("backup", [this, done, error, report, is_beside_scans, folder] {
      if (error.empty() && folder.parent_path() == BackupTarget().parent_path()) {
        backup_fault_.clear();
        backup_is_beside_scans_ = is_beside_scans;
      }
      done(error, report);
    });
  });
  if (!posted) done("too many tasks are waiting: try again", {});
}

/// One folder for each day of the week: the eighth backup replaces the first.
std::filesystem::path StorageUpkeep::BackupTarget() const {
  if (config_.appliance.backup_folder.empty()) return {};
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  return config_.appliance.backup_folder /
         fmt::format("plumb-{}", utc.tm_wday == 0 ? 7 : utc.tm_wday);
}

namespace {

/// True if the folder has no backup younger than that.
bool IsBackupDue(const std::filesystem::path& folder, std::chrono::duration<double> every) {
  using FileClock = std::filesystem::file_time_type::clock;
  for (int day = 1; day <= 7; ++day) {
    std::error_code error;
    const auto made = std::filesystem::last_write_time(
        folder / fmt::format("plumb-{}", day) / "backup.json", error);
    const std::chrono::duration<double> age = FileClock::now() - made;
    if (!error && age.count() >= 0 && age < every)
      return false;  // a time in the future does not count
  }
  return true;
}

}  // namespace

/// The disk for backups may be slow or missing, so the loop does not access it.
void StorageUpkeep::BackUpIfDue() {
  ticks_to_backup_ = kBackupTicks;
  const std::filesystem::path folder = config_.appliance.backup_folder;
  if (folder.empty() || !storage_.IsUsable() || stop_.stop_requested()) return;
  const std::chrono::duration<double> every =
      std::chrono::duration<double, std::ratio<3600>>(config_.appliance.backup_hours);
  (void)reads_.Post([this, folder, every] {
    if (!IsBackupDue(folder, every)) return;
    loop_.Post("backup due", [this] {
      constexpr int kAgainTicks = 3600;  // a failed backup is not repeated at once
      ticks_to_backup_ = kAgainTicks;
      BackUp(kSelf, BackupTarget(), [this](const std::string& error, const BackupReport&) {
        backup_fault_ = error;
        ticks_to_backup_ = error.empty() ? kBackupTicks : kAgainTicks;
      });
    });
  });
}

std::vector<std::string> StorageUpkeep::Warnings(bool is_demo) const {
  std::vector<std::string> warnings;
  if (storage_.IsNearlyFull())
    warnings.push_back(fmt::format("The disk is {:.0f} % full: back up and remove scans.",
                                   100 * storage_.UsedFraction()));
  if (unusable_.references > 0)
    warnings.push_back(fmt::format(
        "The approved references of some patients ({}) cannot be used, because their files are "
        "missing or changed: put the files back from a backup, or scan and approve new references.",
        unusable_.references));
  if (unusable_.scans > 0)
    warnings.push_back(fmt::format(
        "Files of some stored scans ({}) are missing or changed: put them back from a backup, or "
        "remove these scans. The log names them.",
        unusable_.scans));
  if (unusable_.set_aside > 0)
    warnings.push_back(
        fmt::format("Some scan folders ({}) have no entry in the database and were moved to the "
                    "set-aside folder. Restore a more recent backup, or move them to another disk.",
                    unusable_.set_aside));
  if (!record_fault_.empty()) warnings.push_back(record_fault_);
  if (config_.appliance.backup_folder.empty() && !is_demo)
    warnings.emplace_back(
        "No backup is set up: if this disk fails, all scans are lost. Mount another disk for "
        "backups, and name it as backup_folder in [storage].");
  if (!backup_fault_.empty()) warnings.push_back("The last backup failed: " + backup_fault_);
  if (backup_is_beside_scans_)
    warnings.push_back(fmt::format(
        "The last backup lies on the disk of the scans itself and is lost with it: mount the disk "
        "for backups at {}",
        config_.appliance.backup_folder.string()));
  return warnings;
}

}  // namespace plumb
