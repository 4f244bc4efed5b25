// Opening what is stored, and safe mode while it cannot be used.
#include <algorithm>
#include <filesystem>
#include <optional>
#include <thread>
#include <utility>

#include <systemd/sd-daemon.h>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/utf8.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/appliance/provisioning.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/records/stored_values.hpp"

namespace plumb {
namespace {

/// If the display cannot be paired, that is logged, and scanning remains possible.
void PairProvisionedDisplay(const std::filesystem::path& state, Store& store) {
  try {
    const std::optional<Display> display = ProvisionedDisplay(state);
    if (display && store.displays.AddProvisioned(*display))
      Log(LogLevel::kNotice, "the display of the provisioning file is paired");
  } catch (const std::exception& error) {
    Log(LogLevel::kError,
        fmt::format("the display of the provisioning file is not paired: {}", error.what()));
  }
}

}  // namespace

/// On any thread. @throws IoError and its kinds
std::unique_ptr<Store> Appliance::OpenForWork(const std::filesystem::path& state,
                                              StoreOptions options) const {
  options.check_limit = parts_.check_limit;
  auto store = std::make_unique<Store>(state, options);
  // Sessions end with the process: the patient on the couch has to be confirmed again.
  store->treatments.CloseAll(kSelf);
  PairProvisionedDisplay(state, *store);
  return store;
}

void Appliance::UseStore(std::unique_ptr<Store> store) {
  LogRecovery(store->recovery());
  is_database_checked_ = store->recovery().checked_database;
  if (!parts_.demo_patient.empty()) {
    const auto patient = store->patients.FindByCode(parts_.demo_patient);
    open_patient_ = patient ? patient->id : store->patients.Add(kSelf, parts_.demo_patient, "");
    session_id_ = store->treatments.Open(kSelf, open_patient_, ScanPurpose::kFraction);
    opened_by_ = kSelf;
  }
  store_.Replace(std::move(store));
  is_store_open_ = true;
  is_unusable_due_ = true;
}

void Appliance::OpenStore() {
  if (!parts_.configuration_fault.empty())
    return EnterSafeMode(parts_.configuration_fault, StorageFault::kMayEnd);
  // Nothing else runs yet, so the start itself waits for a program that copies the database.
  StoreOptions options;
  options.sleep = [has_logged = false](std::chrono::milliseconds pause) mutable {
    if (!std::exchange(has_logged, true))
      Log(LogLevel::kWarning, "another program holds the database: waiting for it");
    sd_notify(0, "EXTEND_TIMEOUT_USEC=20000000");
    std::this_thread::sleep_for(pause);
  };
  try {
    return UseStore(OpenForWork(parts_.config.appliance.state, options));
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
  storage_fault_ = ValidUtf8(what);  // it may quote a path
  storage_fault_kind_ = kind;
  space_fault_.clear();
  Log(LogLevel::kError, fmt::format("safe mode, nothing can be scanned: {}", what));
  constexpr std::chrono::minutes kLasting{10};
  if (std::chrono::steady_clock::now() - storage_works_since_ > kLasting) num_storage_retries_ = 0;
  ArmStorageRetry();
}

/// Nothing is retried after damage to the database, because somebody may be restoring a backup, nor
/// with an invalid configuration, which does not say which store to open.
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

/// Tries a store that is open for changes: safe mode ends if it can be read and written again.
void Appliance::ProbeStore() {
  try {
    Status status;
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
          // Scans and sessions may have ended while nothing could be written.
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

/// Tries to open a store that could not be opened. If there is no database, none is created: the
/// disk may be missing, or a backup about to be restored.
void Appliance::ReopenStore() {
  const std::filesystem::path& state = parts_.config.appliance.state;
  std::error_code ignored;
  if (!std::filesystem::exists(state / "plumb.db", ignored)) return EndRetry(storage_fault_);
  const bool posted = check_thread_.Post([this, state, fault = storage_fault_] {
    const auto opened = std::make_shared<std::unique_ptr<Store>>();
    std::string what;
    auto kind = StorageFault::kMayEnd;
    StoreOptions options;
    options.lock_wait = std::chrono::milliseconds(0);  // the next try comes soon
    try {
      *opened = OpenForWork(state, options);
      (*opened)->audit.Log(kSelf, "storage.recovered", "", fault);
    } catch (const std::exception& error) {
      opened->reset();
      what = error.what();
      if (dynamic_cast<const DatabaseCorrupt*>(&error) != nullptr) kind = StorageFault::kDamage;
    }
    loop_.Post("storage retry", [this, opened, what, kind] {
      if (!*opened) return EndRetry(what, kind);
      if (storage_fault_kind_ == StorageFault::kDamage) return;  // damage was found in the meantime
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

/// @param what  The present fault; empty: there is none any more.
void Appliance::EndRetry(const std::string& what, StorageFault kind) {
  const std::string fault = ValidUtf8(what);
  if (storage_fault_kind_ == StorageFault::kDamage) return;  // damage was found in the meantime
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
  if (unusable_.set_aside > 0)
    warnings.push_back(fmt::format(
        "Scan folders set aside because they have no entry in the database: {}. Restore a more "
        "recent backup, or move the contents of the set-aside folder to another disk.",
        unusable_.set_aside));
  if (!record_fault_.empty()) warnings.push_back(record_fault_);
  // The demo stores nothing of value.
  if (parts_.config.appliance.backup_folder.empty() && parts_.demo_patient.empty())
    warnings.emplace_back(
        "No backup is set up: if this disk fails, all scans are lost. Mount another disk for "
        "backups, and name it as backup_folder in [storage].");
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

/// Damage replaces a fault that may end by itself.
void Appliance::FailStorage(const std::string& what, StorageFault kind) {
  const bool is_worse =
      kind == StorageFault::kDamage && storage_fault_kind_ != StorageFault::kDamage;
  if (!storage_fault_.empty() && !is_worse) return;
  EnterSafeMode(what, kind);
  (void)Handle(ScanEvent::kStorageFailed);
  PublishState();
}

}  // namespace plumb
