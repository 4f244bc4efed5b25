// Maintenance of stored data: opening, disk space, retention, backups, and the check of its files.
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <limits>
#include <thread>
#include <utility>

#include <systemd/sd-daemon.h>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/records/file_cipher.hpp"

namespace plumb {
namespace {

const web::Actor kSelf{.user = "plumbd", .address = ""};

/// Seconds between the checks of two stored scans, and until the next search for one that is due.
constexpr int kFileCheckTicks = 5, kNoFileCheckTicks = 600;
constexpr std::chrono::hours kFileCheckEvery{24};

bool AreOnOneDisk(const std::filesystem::path& a, const std::filesystem::path& b) {
  struct stat of_a {};
  struct stat of_b {};
  return ::stat(a.c_str(), &of_a) == 0 && ::stat(b.c_str(), &of_b) == 0 &&
         of_a.st_dev == of_b.st_dev;
}

}  // namespace

std::optional<std::filesystem::space_info> Appliance::SpaceForScans() const {
  std::optional<std::filesystem::space_info> least;
  const std::filesystem::path& state = parts_.config.appliance.state;
  for (const std::filesystem::path& folder : {state, state / "scans"}) {
    std::error_code error;
    const std::filesystem::space_info space = std::filesystem::space(folder, error);
    if (!error && space.capacity > 0 && (!least || space.available < least->available))
      least = space;
  }
  return least;
}

void Appliance::OpenStore() {
  if (!parts_.configuration_fault.empty()) {
    storage_fault_ = parts_.configuration_fault;
    Log(LogLevel::kError, fmt::format("safe mode, nothing can be scanned: {}", storage_fault_));
    return;
  }
  try {
    StoreOptions options;
    options.check_limit = parts_.check_limit;
    options.sleep = [has_logged = false](std::chrono::milliseconds pause) mutable {
      if (!std::exchange(has_logged, true))
        Log(LogLevel::kWarning, "another program holds the database: waiting for it");
      sd_notify(0, "EXTEND_TIMEOUT_USEC=20000000");  // the start is still in progress
      std::this_thread::sleep_for(pause);
    };
    store_ = std::make_unique<Store>(parts_.config.appliance.state, options);
    LogRecovery(store_->recovery());
    is_database_checked_ = store_->recovery().checked_database;
    // Sessions end with the process: the patient on the couch has to be confirmed again.
    store_->treatments.CloseAll(kSelf);
    if (!parts_.demo_patient.empty()) {
      const auto patient = store_->patients.FindByCode(parts_.demo_patient);
      open_patient_ = patient ? patient->id : store_->patients.Add(kSelf, parts_.demo_patient, "");
      session_id_ = store_->treatments.Open(kSelf, open_patient_, web::ScanPurpose::kFraction);
      opened_by_ = kSelf;
    }
  } catch (const std::exception& error) {  // the page must show any error
    store_.reset();
    storage_fault_ = error.what();
    Log(LogLevel::kError, fmt::format("safe mode, nothing can be scanned: {}", storage_fault_));
    if (dynamic_cast<const DiskRefused*>(&error) == nullptr) return;
  }
  if (store_) return;
  try {
    store_ = Store::OpenReadable(parts_.config.appliance.state);
    Log(LogLevel::kNotice, "stored data can be read, but not changed");
  } catch (const std::exception& error) {
    Log(LogLevel::kError, fmt::format("read-only access failed too: {}", error.what()));
  }
}

void Appliance::LogRecovery(const RecoveryReport& found) const {
  const std::filesystem::path& state = parts_.config.appliance.state;
  if (found.interrupted_scans + found.orphaned_folders > 0) {
    Log(LogLevel::kWarning,
        fmt::format(
            "recovered after an interruption: {} unfinished scans marked as failed, {} folders "
            "of unfinished, failed or removed scans deleted",
            found.interrupted_scans, found.orphaned_folders));
  }
  if (!found.checked_database)
    Log(LogLevel::kNotice,
        "the database is too large to be checked as a whole at the start: that goes on now");
  if (found.lost_scans > 0) {
    Log(LogLevel::kError,
        fmt::format("the files of {} scans cannot be seen: they are marked unavailable until the "
                    "files are back, nothing was deleted; the audit log names them",
                    found.lost_scans));
  }
  if (found.attached_scans > 0)
    Log(LogLevel::kNotice, fmt::format("the files of {} scans are back", found.attached_scans));
  if (found.foreign_folders > 0) {
    Log(LogLevel::kError,
        fmt::format("{} scans are unknown to the database and were moved to {}: is it an older "
                    "backup? They can be read with plumb info",
                    found.foreign_folders, (state / ScanFolders::kSetAside).string()));
  }
  if (found.broken_references > 0) {
    Log(LogLevel::kError, fmt::format("the files of {} approved references cannot be seen: put a "
                                      "backup of the state folder in its place",
                                      found.broken_references));
  }
}

/// Upper limit for the space of the next scan.
std::uint64_t Appliance::NeededBytes() const {
  // Measured: a compared scan of 640x480 takes 40 MB; a recording takes 2.35 bytes per pixel and
  // frame.
  constexpr double kScene = 16e6, kSceneOfPixel = 110.0, kFrameOfPixel = 2.6, kFramesPerSecond = 30;
  const Intrinsics camera = sensors_->snapshot().info.intrinsics;
  const double pixels = std::max(320.0 * 240.0, static_cast<double>(camera.width) * camera.height);
  const web::Settings settings = store_ ? store_->settings.Get() : web::Settings{};
  double bytes = kScene + kSceneOfPixel * pixels;
  if (!check_ && (parts_.config.appliance.keep_recordings || settings.keep_recordings)) {
    const double sweep_s = parts_.config.appliance.scan_limit_s.value_or(settings.scan_limit_s);
    bytes += kFrameOfPixel * pixels * kFramesPerSecond * sweep_s;
  }
  return static_cast<std::uint64_t>(bytes);
}

/// Why no scan can be stored now; empty if one can.
Appliance::Answer Appliance::WhyNoSpace() const {
  const auto space = SpaceForScans();
  if (!space) return {};  // a disk that cannot be examined is reported elsewhere
  try {
    const std::uint64_t needed = NeededBytes();
    if (space->available >= needed) return {};
    return fmt::format(
        "the disk is full: {} MB are free, a scan may need {}; remove scans that are not wanted",
        space->available / 1'000'000, needed / 1'000'000);
  } catch (const std::exception& failure) {
    return fmt::format("no scan can begin: {}", failure.what());
  }
}

std::vector<std::string> Appliance::StorageWarnings() const {
  constexpr double kNearlyFull = 0.8;
  std::vector<std::string> warnings;
  if (const auto space = SpaceForScans()) {
    const double used =
        1.0 - static_cast<double>(space->available) / static_cast<double>(space->capacity);
    if (used >= kNearlyFull)
      warnings.push_back(
          fmt::format("The disk is {:.0f} % full: back up and remove scans.", 100 * used));
  }
  if (!record_fault_.empty()) warnings.push_back(record_fault_);
  if (!backup_fault_.empty()) warnings.push_back("The last backup failed: " + backup_fault_);
  if (backup_is_beside_scans_)
    warnings.push_back(fmt::format(
        "The last backup lies on the disk of the scans itself and is lost with it: mount the disk "
        "for backups at {}",
        parts_.config.appliance.backup_folder.string()));
  return warnings;
}

/// As configured, otherwise a fraction of the disk that holds the scans.
std::uint64_t Appliance::QuotaBytes() const {
  constexpr double kShare = 0.9;
  if (parts_.config.appliance.quota_gb)
    return static_cast<std::uint64_t>(*parts_.config.appliance.quota_gb * 1e9);
  std::error_code error;
  const std::filesystem::space_info space =
      std::filesystem::space(parts_.config.appliance.state / "scans", error);
  if (error || space.capacity == 0) return std::numeric_limits<std::uint64_t>::max();
  return static_cast<std::uint64_t>(kShare * static_cast<double>(space.capacity));
}

/// Detects a disk that has become read-only before a patient is scanned in vain. Runs off the loop.
void Appliance::CheckDisk() {
  ticks_to_disk_check_ = kDiskCheckTicks;
  if (store_ == nullptr || !storage_fault_.empty()) return;
  (void)store_thread_.Post([this] {
    try {
      store_->CheckWritable();
    } catch (const DiskRefused& error) {
      loop_.Post("disk check", [this, what = std::string(error.what())] { FailStorage(what); });
    }
  });
}

void Appliance::FailStorage(const std::string& what) {
  if (!storage_fault_.empty()) return;
  storage_fault_ = what;
  Log(LogLevel::kError, fmt::format("safe mode, nothing can be scanned: {}", what));
  (void)Handle(ScanEvent::kStorageFailed);
  PublishState();
}

/// Retention and quota, off the loop.
void Appliance::RunMaintenance() {
  ticks_to_maintenance_ = kMaintenanceTicks;
  if (store_ == nullptr || !storage_fault_.empty() || stopped_) return;
  // within this time a time server may still correct the clock
  constexpr std::chrono::hours kTrusted{1};
  const bool has_clock = clock_.held() >= kTrusted;
  const std::uint64_t quota = QuotaBytes();
  const bool posted = store_thread_.Post([this, quota, has_clock, stop = care_.get_token()] {
    try {
      const int old =
          has_clock ? store_->removal.RemoveOldScans(store_->settings.Get().retention_days, stop)
                    : 0;
      const int over = store_->removal.KeepWithinQuota(quota, stop);
      if (old + over > 0)
        Log(LogLevel::kNotice,
            fmt::format("removed {} scans for their age, {} for the quota", old, over));
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot remove old scans: {}", error.what()));
    }
  });
  if (!posted) Log(LogLevel::kWarning, "the store is too busy to remove old scans now");
}

/// Verifies the audit log once a day, off the loop: its chain of digests protects nothing unless
/// it is checked.
void Appliance::CheckRecords() {
  constexpr int kDayTicks = 24 * 3600, kAgainTicks = 60;
  ticks_to_record_check_ = kDayTicks;
  if (store_ == nullptr || !storage_fault_.empty()) return;
  const bool posted = check_thread_.Post([this] {
    std::string fault;
    try {
      if (!std::exchange(is_database_checked_, true)) {
        constexpr std::chrono::minutes kLongest{30};
        Database(parts_.config.appliance.state / "plumb.db", Database::Access::kReadOnly)
            .CheckIntegrity(kLongest);
      }
      if (const std::optional<std::int64_t> broken = store_->audit.FirstBroken())
        fault = fmt::format(
            "The audit log has been changed or shortened from outside: entry {} is not as it was "
            "written. Compare it with a backup",
            *broken);
    } catch (const DatabaseCorrupt& error) {
      loop_.Post("record check", [this, what = std::string(error.what())] { FailStorage(what); });
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
void Appliance::CheckStoredFiles() {
  ticks_to_file_check_ = kNoFileCheckTicks;  // until this check has ended
  if (store_ == nullptr || !storage_fault_.empty() || stopped_) return;
  (void)check_thread_.Post([this, stop = care_.get_token()] {
    std::optional<CheckedScan> checked;
    try {
      checked = store_->integrity.CheckNext(kFileCheckEvery, stop);
    } catch (const Interrupted&) {
      return;
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot check the stored scans: {}", error.what()));
    }
    if (checked) {
      loop_.Post("file check", [this, checked] {
        ticks_to_file_check_ = kFileCheckTicks;
        if (checked->fault.empty()) return;
        Log(LogLevel::kError,
            fmt::format("a stored scan has changed or is missing: {}", checked->fault),
            {{"SCAN", checked->id}});
        NotifyWeb(web::EventKind::kData);
      });
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

void Appliance::BackUp(
    const web::Actor& actor, const std::filesystem::path& folder,
    std::function<void(const std::string& error, const BackupReport& report)> done,
    const std::filesystem::path& key_file) {
  if (store_ == nullptr || !storage_fault_.empty())
    return done("nothing can be backed up in safe mode: " + storage_fault_, {});
  const std::filesystem::path key =
      key_file.empty() ? parts_.config.appliance.backup_key_file : key_file;
  const bool posted =
      check_thread_.Post([this, actor, folder, done, key, stop = care_.get_token()] {
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
          if (error.empty() && folder == BackupTarget()) backup_is_beside_scans_ = is_beside_scans;
          done(error, report);
        });
      });
  if (!posted) done("too many tasks are waiting: try again", {});
}

/// One folder for each day of the week: the eighth backup replaces the first.
std::filesystem::path Appliance::BackupTarget() const {
  if (parts_.config.appliance.backup_folder.empty()) return {};
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  return parts_.config.appliance.backup_folder /
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
void Appliance::BackUpIfDue() {
  ticks_to_backup_ = kBackupTicks;
  const std::filesystem::path folder = parts_.config.appliance.backup_folder;
  if (folder.empty() || store_ == nullptr || !storage_fault_.empty() || stopped_) return;
  const std::chrono::duration<double> every =
      std::chrono::duration<double, std::ratio<3600>>(parts_.config.appliance.backup_hours);
  (void)check_thread_.Post([this, folder, every] {
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

}  // namespace plumb
