// Maintenance of stored data: opening, disk space, retention, backups, and the check of its files.
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
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
    const std::filesystem::space_info space = SpaceOf(folder, error);
    if (!error && space.capacity > 0 && (!least || space.available < least->available))
      least = space;
  }
  return least;
}

std::filesystem::space_info Appliance::SpaceOf(const std::filesystem::path& folder,
                                               std::error_code& error) const {
  return parts_.space ? parts_.space(folder, error) : std::filesystem::space(folder, error);
}

/// On any thread. @throws IoError and its kinds
std::unique_ptr<Store> Appliance::OpenForWork(const std::filesystem::path& state,
                                              std::chrono::milliseconds lock_wait) const {
  StoreOptions options;
  options.check_limit = parts_.check_limit;
  options.lock_wait = lock_wait;
  options.sleep = [has_logged = false](std::chrono::milliseconds pause) mutable {
    if (!std::exchange(has_logged, true))
      Log(LogLevel::kWarning, "another program holds the database: waiting for it");
    sd_notify(0, "EXTEND_TIMEOUT_USEC=20000000");  // the start is still in progress
    std::this_thread::sleep_for(pause);
  };
  auto store = std::make_unique<Store>(state, options);
  // Sessions end with the process: the patient on the couch has to be confirmed again.
  store->treatments.CloseAll(kSelf);
  return store;
}

void Appliance::UseStore(std::unique_ptr<Store> store) {
  LogRecovery(store->recovery());
  is_database_checked_ = store->recovery().checked_database;
  if (!parts_.demo_patient.empty()) {
    const auto patient = store->patients.FindByCode(parts_.demo_patient);
    open_patient_ = patient ? patient->id : store->patients.Add(kSelf, parts_.demo_patient, "");
    session_id_ = store->treatments.Open(kSelf, open_patient_, web::ScanPurpose::kFraction);
    opened_by_ = kSelf;
  }
  store_.Replace(std::move(store));
  is_store_open_ = true;
  is_unusable_due_ = true;
}

void Appliance::OpenStore() {
  if (!parts_.configuration_fault.empty())
    return EnterSafeMode(parts_.configuration_fault, StorageFault::kMayEnd);
  try {
    return UseStore(OpenForWork(parts_.config.appliance.state, StoreOptions().lock_wait));
  } catch (const DatabaseCorrupt& error) {
    return EnterSafeMode(error.what(), StorageFault::kDamage);
  } catch (const DiskRefused& error) {
    EnterSafeMode(error.what(), StorageFault::kMayEnd);
  } catch (const std::exception& error) {  // the page must show any error
    return EnterSafeMode(error.what(), StorageFault::kMayEnd);
  }
  try {
    store_.Replace(Store::OpenReadable(parts_.config.appliance.state));
    Log(LogLevel::kNotice, "stored data can be read, but not changed");
  } catch (const std::exception& error) {
    Log(LogLevel::kError, fmt::format("read-only access failed too: {}", error.what()));
  }
}

void Appliance::EnterSafeMode(const std::string& what, StorageFault kind) {
  storage_fault_ = what;
  storage_fault_kind_ = kind;
  space_fault_.clear();
  Log(LogLevel::kError, fmt::format("safe mode, nothing can be scanned: {}", what));
  constexpr std::chrono::minutes kLasting{10};
  if (std::chrono::steady_clock::now() - storage_works_since_ > kLasting) num_storage_retries_ = 0;
  ArmStorageRetry();
}

/// A damaged database is left to a person: a backup may be being put in its place. With a wrong
/// configuration, the store to open is not known.
void Appliance::ArmStorageRetry() {
  if (storage_fault_kind_ == StorageFault::kDamage || !parts_.configuration_fault.empty() ||
      parts_.storage_retries.empty())
    return storage_timer_.Disarm();
  const std::size_t last = parts_.storage_retries.size() - 1;
  storage_timer_.ArmAfter(parts_.storage_retries[std::min(num_storage_retries_++, last)]);
}

void Appliance::RetryStorage() {
  if (storage_fault_.empty() || storage_fault_kind_ == StorageFault::kDamage || stopped_) return;
  if (IsRunning()) return ArmStorageRetry();  // a scan that is being cancelled ends first
  return is_store_open_ ? ProbeStore() : ReopenStore();
}

/// Of a store that was opened for changes: it has to be read and written without a fault.
void Appliance::ProbeStore() {
  try {
    web::Status status;
    ReadStored(status);
  } catch (const DatabaseCorrupt& error) {
    return EndRetry(error.what(), StorageFault::kDamage);
  } catch (const std::exception& error) {
    return EndRetry(error.what());
  }
  const bool posted =
      store_thread_.Post([this, fault = storage_fault_, has_session = !session_id_.empty()] {
        std::string what;
        try {
          store_->CheckWritable();
          // What could not be written while the fault lasted: the ends of scans and of sessions.
          FailInterruptedScans(*store_->database().ForChanges());
          if (!has_session) store_->treatments.CloseAll(kSelf);
          store_->audit.Log(kSelf, "storage.recovered", "", fault);
        } catch (const std::exception& error) {
          what = error.what();
        }
        loop_.Post("storage retry", [this, what] { EndRetry(what); });
      });
  if (!posted) EndRetry(storage_fault_);
}

/// Of a store that could not be opened. Without a database there is nothing to come back to: a new
/// one must not be created in a folder whose disk is missing or which is about to be restored.
void Appliance::ReopenStore() {
  const std::filesystem::path& state = parts_.config.appliance.state;
  std::error_code ignored;
  if (!std::filesystem::exists(state / "plumb.db", ignored)) return EndRetry(storage_fault_);
  const bool posted = check_thread_.Post([this, state, fault = storage_fault_] {
    const auto opened = std::make_shared<std::unique_ptr<Store>>();
    std::string what;
    auto kind = StorageFault::kMayEnd;
    try {
      *opened = OpenForWork(state, std::chrono::milliseconds(0));
      (*opened)->audit.Log(kSelf, "storage.recovered", "", fault);
    } catch (const std::exception& error) {
      opened->reset();
      what = error.what();
      if (dynamic_cast<const DatabaseCorrupt*>(&error) != nullptr) kind = StorageFault::kDamage;
    }
    loop_.Post("storage retry", [this, opened, what, kind] {
      if (!*opened) return EndRetry(what, kind);
      if (storage_fault_kind_ == StorageFault::kDamage) return;  // found meanwhile
      try {
        UseStore(std::move(*opened));
      } catch (const std::exception& error) {
        return EndRetry(error.what());
      }
      EndRetry({});
    });
  });
  if (!posted) EndRetry(storage_fault_);
}

/// @param fault  The present one; empty: there is none any more.
void Appliance::EndRetry(const std::string& fault, StorageFault kind) {
  if (storage_fault_kind_ == StorageFault::kDamage) return;  // found meanwhile
  if (fault.empty()) return LeaveSafeMode();
  storage_fault_kind_ = kind;
  if (fault != storage_fault_) {
    storage_fault_ = fault;
    Log(LogLevel::kError, fmt::format("still in safe mode: {}", fault));
    PublishState();
  }
  ArmStorageRetry();
}

void Appliance::LeaveSafeMode() {
  Log(LogLevel::kNotice, fmt::format("safe mode has ended, what is stored can be used again; the "
                                     "fault was: {}",
                                     storage_fault_));
  storage_fault_.clear();
  storage_works_since_ = std::chrono::steady_clock::now();
  (void)Handle(ScanEvent::kStorageWorks);
  WatchSpace();
  RefreshRoom();
  RunMaintenance();
  CheckRecords();
  NotifyWeb(web::EventKind::kStatus);
  NotifyWeb(web::EventKind::kData);
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

/// Why the disk has no room for a scan; empty if it has. @throws IoError if the settings cannot be
/// read
Appliance::Answer Appliance::WhyFull() const {
  const auto space = SpaceForScans();
  if (!space) return {};  // a disk that cannot be examined is reported elsewhere
  const std::uint64_t needed = NeededBytes();
  if (space->available >= needed) return {};
  return fmt::format(
      "the disk is full: {} MB are free, a scan may need {}; remove scans that are not wanted",
      space->available / 1'000'000, needed / 1'000'000);
}

/// Why no scan can be stored now; empty if one can.
Appliance::Answer Appliance::WhyNoSpace() const {
  try {
    return WhyFull();
  } catch (const std::exception& failure) {
    return fmt::format("no scan can begin: {}", failure.what());
  }
}

/// State and light must not say "ready" while each press is refused. A result, or the failure of a
/// scan, stays until it has been seen.
void Appliance::WatchSpace() {
  if (IsRunning() || state_.phase == ScanPhase::kResult || state_.fault == FaultKind::kScan ||
      !storage_fault_.empty())
    return;
  Answer why;
  try {
    why = WhyFull();
  } catch (const std::exception&) {
    return;  // told by the status, which reads the same settings
  }
  const bool has_changed = why.empty() != space_fault_.empty();
  space_fault_ = why;
  if (has_changed) {
    Log(why.empty() ? LogLevel::kNotice : LogLevel::kError,
        why.empty() ? "there is room for scans again" : why);
    (void)Handle(why.empty() ? ScanEvent::kStorageWorks : ScanEvent::kStorageFailed);
  }
  if (Pattern() == shown_) return;  // the disk may have become nearly full
  Show();
  NotifyWeb(web::EventKind::kStatus);
}

/// Of the disk with less room, as df says it: without what is kept for root. 0 if it cannot be
/// examined.
double Appliance::UsedShare() const {
  const auto space = SpaceForScans();
  if (!space || space->capacity < space->free) return 0.0;
  const auto used = static_cast<double>(space->capacity - space->free);
  const double total = used + static_cast<double>(space->available);
  return total > 0 ? used / total : 1.0;
}

bool Appliance::IsNearlyFull() const {
  constexpr double kNearlyFull = 0.8;
  return UsedShare() >= kNearlyFull;
}

/// Off the loop: it goes through all scans.
void Appliance::CountUnusable() {
  if (!is_store_open_ || !storage_fault_.empty()) return;
  is_unusable_due_ = !store_thread_.Post([this] {
    try {
      const UnusableRecords found = store_->integrity.CountUnusable();
      loop_.Post("unusable", [this, found] {
        if (found == unusable_) return;
        unusable_ = found;
        NotifyWeb(web::EventKind::kStatus);
      });
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot count unusable scans: {}", error.what()));
    }
  });
}

std::vector<std::string> Appliance::StorageWarnings() const {
  std::vector<std::string> warnings;
  if (IsNearlyFull())
    warnings.push_back(
        fmt::format("The disk is {:.0f} % full: back up and remove scans.", 100 * UsedShare()));
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
  if (!record_fault_.empty()) warnings.push_back(record_fault_);
  if (!backup_fault_.empty()) warnings.push_back("The last backup failed: " + backup_fault_);
  if (backup_is_beside_scans_)
    warnings.push_back(fmt::format(
        "The last backup lies on the disk of the scans itself and is lost with it: mount the disk "
        "for backups at {}",
        parts_.config.appliance.backup_folder.string()));
  return warnings;
}

/// Detects a disk that has become read-only before a patient is scanned in vain. Runs off the loop.
void Appliance::CheckDisk() {
  ticks_to_disk_check_ = kDiskCheckTicks;
  if (store_ == nullptr || !storage_fault_.empty()) return;
  (void)store_thread_.Post([this] {
    try {
      store_->CheckWritable();
    } catch (const std::exception& error) {
      loop_.Post("disk check", [this, what = std::string(error.what())] {
        FailStorage(what, StorageFault::kMayEnd);
      });
    }
  });
}

/// Damage takes the place of a fault that may end by itself.
void Appliance::FailStorage(const std::string& what, StorageFault kind) {
  const bool is_worse =
      kind == StorageFault::kDamage && storage_fault_kind_ != StorageFault::kDamage;
  if (!storage_fault_.empty() && !is_worse) return;
  EnterSafeMode(what, kind);
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
  const std::optional<double> quota_gb = parts_.config.appliance.quota_gb;
  const bool posted = store_thread_.Post([this, quota_gb, has_clock, stop = care_.get_token()] {
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

/// Without a configured quota; on the store's thread. Where it frees nothing it is not tried again:
/// each time would cost another scan.
int Appliance::KeepWithinRoom(const std::stop_token& stop) {
  if (!is_quota_useful_) return 0;
  std::error_code error;
  const auto free_bytes = [&]() -> std::uint64_t {
    const std::filesystem::space_info space = SpaceOf(store_->folders.scans(), error);
    return error ? 0 : space.available;
  };
  (void)free_bytes();
  if (error) return 0;
  const StoreRemoval::Room room = store_->removal.KeepWithinRoom(free_bytes, stop);
  is_quota_useful_ = room.has_helped;
  if (!is_quota_useful_)
    Log(LogLevel::kError,
        "the disk is nearly full, and the removal of an old scan freed nothing: a backup on the "
        "same disk may hold its files, or another program fills the disk. No more scans are "
        "removed for the quota until the next start");
  return room.num_removed;
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
      // The journal is kept elsewhere: a log that somebody wrote anew does not end like this.
      if (const AuditHead head = store_->audit.Head(); fault.empty())
        Log(LogLevel::kInfo, fmt::format("the audit log is whole up to entry {}, chain {}",
                                         head.number, head.chain));
    } catch (const DatabaseCorrupt& error) {
      loop_.Post("record check", [this, what = std::string(error.what())] {
        FailStorage(what, StorageFault::kDamage);
      });
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
