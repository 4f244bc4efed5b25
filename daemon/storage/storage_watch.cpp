// SPDX-License-Identifier: Apache-2.0
#include "daemon/storage/storage_watch.hpp"

#include <sys/statvfs.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <thread>
#include <utility>

#include <systemd/sd-daemon.h>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/utf8.hpp"
#include "daemon/database/database.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/storage/kept_clock.hpp"
#include "daemon/unit/provisioning.hpp"

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

/// As it is, or verbatim with what is not UTF-8 replaced: it may quote a path.
Message Printable(const Message& message) {
  const std::string text = message.English();
  std::string valid = ValidUtf8(text);
  return valid == text ? message : Message::Verbatim(valid);
}

StorageWatch::Fault KindOf(const std::exception& error) {
  return dynamic_cast<const DatabaseCorrupt*>(&error) != nullptr ? StorageWatch::Fault::kDamage
                                                                 : StorageWatch::Fault::kMayEnd;
}

}  // namespace

StorageWatch::StorageWatch(EventLoop& loop, StorageOptions options, WorkThread& changes,
                           WorkThread& reads)
    : loop_(loop),
      options_(std::move(options)),
      changes_(changes),
      reads_(reads),
      timer_(loop.MakeTimer("storage retry", [this] { Retry(); })) {}

/// On any thread. @throws IoError and its kinds
std::unique_ptr<Store> StorageWatch::OpenForWork(StoreOptions options) const {
  options.check_limit = options_.check_limit;
  options.first_settings = options_.first_settings;
  auto store = std::make_unique<Store>(options_.state, options);
  // Sessions end with the process: the patient on the couch has to be confirmed again.
  store->treatments.CloseAll(kSelf);
  PairProvisionedDisplay(options_.state, *store);
  return store;
}

void StorageWatch::Use(std::unique_ptr<Store> store) {
  LogRecovery(store->recovery());
  user_->StoreOpened(*store);
  store_.Replace(std::move(store));
  is_open_ = true;
}

void StorageWatch::Open(StorageUser& user) {
  user_ = &user;
  if (has_configuration_fault()) return EnterSafeMode(options_.configuration_fault, Fault::kMayEnd);
  // Nothing else runs yet, so the start itself waits for a program that copies the database.
  StoreOptions options;
  options.sleep = [has_logged = false](std::chrono::milliseconds pause) mutable {
    if (!std::exchange(has_logged, true))
      Log(LogLevel::kWarning, "another program holds the database: waiting for it");
    sd_notify(0, "EXTEND_TIMEOUT_USEC=20000000");
    std::this_thread::sleep_for(pause);
  };
  try {
    return Use(OpenForWork(options));
  } catch (const DiskRefused& error) {
    EnterSafeMode(error.message(), Fault::kMayEnd);
  } catch (const std::exception& error) {  // the page must show any error
    return EnterSafeMode(MessageOf(error), KindOf(error));
  }
  try {
    store_.Replace(Store::OpenReadable(options_.state, options_.first_settings));
    Log(LogLevel::kNotice, "stored data can be read, but not changed");
  } catch (const std::exception& error) {
    Log(LogLevel::kError, fmt::format("read-only access failed too: {}", error.what()));
  }
}

void StorageWatch::EnterSafeMode(const Message& what, Fault kind) {
  fault_ = Printable(what);
  kind_ = kind;
  Log(LogLevel::kError, fmt::format("safe mode, nothing can be scanned: {}", what.English()));
  constexpr std::chrono::minutes kLasting{10};
  if (std::chrono::steady_clock::now() - works_since_ > kLasting) num_retries_ = 0;
  ArmRetry();
}

/// Nothing is retried after damage to the database, because somebody may be restoring a backup, nor
/// with an invalid configuration, which does not say which store to open.
void StorageWatch::ArmRetry() {
  if (kind_ == Fault::kDamage || has_configuration_fault() || options_.retries.empty())
    return timer_.Disarm();
  const std::size_t last = options_.retries.size() - 1;
  timer_.ArmAfter(options_.retries[std::min(num_retries_++, last)]);
}

void StorageWatch::Retry() {
  if (fault_.empty() || kind_ == Fault::kDamage || stopped_) return;
  if (user_->IsRunning()) return ArmRetry();  // a scan that is being cancelled ends first
  return is_open_ ? Probe() : Reopen();
}

/// Tries a store that is open for changes: safe mode ends if it can be read and written again.
void StorageWatch::Probe() {
  try {
    user_->ReadAll();
  } catch (const std::exception& error) {
    return EndRetry(MessageOf(error), KindOf(error));
  }
  const bool posted = changes_.Post([this, fault = fault_, has_session = user_->HasSession()] {
    Message what;
    try {
      store_->CheckWritable();
      // Scans and sessions may have ended while nothing could be written.
      FailInterruptedScans(*store_->database().ForChanges());
      if (!has_session) store_->treatments.CloseAll(kSelf);
      store_->audit.Log(kSelf, "storage.recovered", "", fault);
    } catch (const std::exception& error) {
      what = MessageOf(error);
    }
    loop_.Post("storage retry", [this, what] { EndRetry(what); });
  });
  if (!posted) EndRetry(fault_);
}

/// Tries to open a store that could not be opened. If there is no database, none is created: the
/// disk may be missing, or a backup about to be restored.
void StorageWatch::Reopen() {
  std::error_code ignored;
  if (!std::filesystem::exists(options_.state / kDatabaseFile, ignored)) return EndRetry(fault_);
  const bool posted = reads_.Post([this, fault = fault_] {
    const auto opened = std::make_shared<std::unique_ptr<Store>>();
    Message what;
    auto kind = Fault::kMayEnd;
    StoreOptions options;
    options.lock_wait = std::chrono::milliseconds(0);  // the next try comes soon
    try {
      *opened = OpenForWork(options);
      (*opened)->audit.Log(kSelf, "storage.recovered", "", fault);
    } catch (const std::exception& error) {
      opened->reset();
      what = MessageOf(error);
      kind = KindOf(error);
    }
    loop_.Post("storage retry", [this, opened, what, kind] {
      if (!*opened) return EndRetry(what, kind);
      if (kind_ == Fault::kDamage) return;  // damage was found in the meantime
      try {
        Use(std::move(*opened));
      } catch (const std::exception& error) {
        return EndRetry(MessageOf(error));
      }
      EndRetry({});
    });
  });
  if (!posted) EndRetry(fault_);
}

/// @param what  The present fault; empty: there is none any more.
void StorageWatch::EndRetry(const Message& what, Fault kind) {
  const Message fault = Printable(what);
  if (kind_ == Fault::kDamage) return;  // damage was found in the meantime
  if (fault.empty()) return LeaveSafeMode();
  kind_ = kind;
  if (!(fault == fault_)) {
    fault_ = fault;
    Log(LogLevel::kError, fmt::format("still in safe mode: {}", fault.English()));
    user_->StorageFaultChanged();
  }
  ArmRetry();
}

void StorageWatch::LeaveSafeMode() {
  Log(LogLevel::kNotice, fmt::format("safe mode has ended, what is stored can be used again; the "
                                     "fault was: {}",
                                     fault_.English()));
  fault_ = {};
  works_since_ = std::chrono::steady_clock::now();
  user_->StorageWorks();
}

void StorageWatch::LogRecovery(const RecoveryReport& found) const {
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
                    found.foreign_folders, (options_.state / ScanFolders::kSetAside).string()));
  }
  if (found.broken_references > 0) {
    Log(LogLevel::kError, fmt::format("the files of {} approved references cannot be seen: put a "
                                      "backup of the state folder in its place",
                                      found.broken_references));
  }
}

void StorageWatch::CheckDisk() {
  if (!IsUsable()) return;
  (void)changes_.Post([this] {
    try {
      store_->CheckWritable();
    } catch (const std::exception& error) {
      loop_.Post("disk check", [this, what = MessageOf(error)] { Fail(what, Fault::kMayEnd); });
    }
  });
}

/// Damage replaces a fault that may end by itself.
void StorageWatch::Fail(const Message& what, Fault kind) {
  const bool is_worse = kind == Fault::kDamage && kind_ != Fault::kDamage;
  if (!fault_.empty() && !is_worse) return;
  EnterSafeMode(what, kind);
  user_->StorageFailed();
}

void StorageWatch::FailLater(const std::exception& error) {
  loop_.Post("store failed",
             [this, what = MessageOf(error), kind = KindOf(error)] { Fail(what, kind); });
}

bool StorageWatch::IsReadOnly() const {
  struct statvfs status {};
  return ::statvfs(options_.state.c_str(), &status) != 0 || (status.f_flag & ST_RDONLY) != 0;
}

std::optional<std::filesystem::space_info> StorageWatch::SpaceForScans() const {
  std::optional<std::filesystem::space_info> least;
  for (const std::filesystem::path& folder : {options_.state, options_.state / "scans"}) {
    std::error_code error;
    const std::filesystem::space_info space = SpaceOf(folder, error);
    if (!error && space.capacity > 0 && (!least || space.available < least->available))
      least = space;
  }
  return least;
}

std::filesystem::space_info StorageWatch::SpaceOf(const std::filesystem::path& folder,
                                                  std::error_code& error) const {
  return options_.space ? options_.space(folder, error) : std::filesystem::space(folder, error);
}

double StorageWatch::UsedFraction() const {
  const auto space = SpaceForScans();
  if (!space || space->capacity < space->free) return 0.0;
  const auto used = static_cast<double>(space->capacity - space->free);
  const double total = used + static_cast<double>(space->available);
  return total > 0 ? used / total : 1.0;
}

bool StorageWatch::IsClockKept() const {
  return options_.is_clock_kept ? options_.is_clock_kept() : plumb::IsClockKept();
}

bool StorageWatch::IsNearlyFull() const {
  constexpr double kNearlyFull = 0.8;
  return UsedFraction() >= kNearlyFull;
}

}  // namespace plumb
