// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/store.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "daemon/database/clock_doubt.hpp"
#include "daemon/database/database_mark.hpp"
#include "daemon/database/page_seals.hpp"
#include "daemon/database/retry_while_busy.hpp"
#include "daemon/database/row_digests.hpp"
#include "daemon/database/schema.hpp"
#include "daemon/state_folder/old_copies.hpp"
#include "daemon/state_folder/restore_note.hpp"
#include "daemon/state_folder/scan_numbers.hpp"
#include "drivers/files/file_io.hpp"
#include "words/store.hpp"

namespace plumb {

namespace fs = std::filesystem;

namespace {

FolderPlace PlaceOf(const fs::path& folder) {
  struct stat status {};
  if (::stat(folder.c_str(), &status) != 0) return {};
  return {.disk = status.st_dev, .inode = status.st_ino};
}

void RequireWritable(const fs::path& folder) {
  const fs::path probe = folder / ".writable";
  const int fd = ::open(probe.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
  const int reason = fd < 0 ? errno : 0;
  if (fd >= 0) {
    ::close(fd);
    ::unlink(probe.c_str());
  }
  if (reason == 0 || reason == ENOSPC || reason == EDQUOT || reason == EMFILE || reason == ENFILE)
    return;
  throw DiskRefused(say::store::NotWritable(folder.string(), std::strerror(reason)));
}

/// scans/ may be a disk of its own.
void RequireWritable(const ScanFolders& folders) {
  RequireWritable(folders.state());
  std::error_code ignored;
  if (fs::is_directory(folders.scans(), ignored)) RequireWritable(folders.scans());
}

/// Keeps a copy of a damaged database's files before a restore or somebody's repair changes them.
/// The same damage is copied only once, and only a few copies are kept.
void KeepDamaged(const fs::path& state) {
  constexpr std::size_t kLongest = std::size_t{1} << 28U;
  constexpr int kMostKept = 3;
  const std::array<std::string, 6> names = {kDatabaseFile,
                                            "plumb.db-wal",
                                            "plumb.db-shm",
                                            "plumb.db-journal",
                                            std::string(kDatabaseFile) + kMarkSuffix,
                                            std::string(kDatabaseFile) + kSealsSuffix};
  try {
    std::error_code error;
    std::string sums;
    for (const std::string& name : names) {
      if (fs::exists(state / name, error))
        sums += Sha256Of(ReadTextFile(state / name, kLongest)) + name;
    }
    constexpr std::size_t kNameLength = 12;
    const fs::path kept =
        state / (std::string(kDamagedPrefix) + Sha256Of(sums).substr(0, kNameLength));
    int num_kept = 0;
    for (const fs::directory_entry& entry : fs::directory_iterator(state))
      num_kept += entry.path().filename().string().starts_with(kDamagedPrefix) ? 1 : 0;
    if (fs::exists(kept, error) || num_kept >= kMostKept) return;
    const fs::path copy = state / ".damaged";
    fs::remove_all(copy);
    fs::create_directory(copy);
    for (const std::string& name : names) {
      if (fs::exists(state / name, error)) fs::copy_file(state / name, copy / name);
    }
    SyncWholeDisk(state);
    fs::rename(copy, kept);
  } catch (const std::exception&) {  // the disk may be the reason for the damage
  }
}

/// A program that copies the database holds it for a while; another plumbd does not release it.
std::unique_ptr<Database> OpenChecked(const fs::path& state, const StoreOptions& options,
                                      bool& is_checked) {
  constexpr std::chrono::milliseconds kPause(500);
  return RetryWhileBusy(options.lock_wait, kPause, options.sleep, [&] {
    try {
      auto database = std::make_unique<Database>(state / kDatabaseFile,
                                                 Database::Access::kReadWrite, options.busy_wait);
      is_checked = database->CheckIntegrity(options.check_limit);
      return database;
    } catch (const DatabaseCorrupt&) {
      KeepDamaged(state);
      throw;
    }
  });
}

/// Accounts do not vanish by themselves, and where there is none, a stranger could create the
/// first.
void RefuseLostAccounts(Database& database, const fs::path& state) {
  if (database.Has("SELECT 1 FROM users")) return;
  if (database.Has("SELECT 1 FROM audit WHERE action = 'user.add' AND number > (SELECT "
                   "ifnull(max(number), 0) FROM audit WHERE action = 'system.factory_reset')"))
    throw DatabaseCorrupt(say::store::AccountsGone((state / kDatabaseFile).string()));
}

/// The connection for changes, to a database of this version that belongs to this folder's scans.
std::unique_ptr<Database> OpenForChanges(const ScanFolders& folders, const StoreOptions& options,
                                         FolderLock& lock, RecoveryReport& recovery) {
  std::error_code error;
  fs::create_directories(folders.state(), error);
  if (error) throw DiskRefused(DescribeWriteError(folders.state(), error.value()));
  RequireWritable(folders);
  lock.Take(folders.state());
  std::unique_ptr<Database> database =
      OpenChecked(folders.state(), options, recovery.checked_database);
  RefuseScansOfAnother(*database, folders);
  const std::int64_t version = database->FirstInteger("PRAGMA user_version").value_or(0);
  Migrate(*database);
  RefuseLostAccounts(*database, folders.state());
  KeepRowDigests(*database, folders.state(),
                 version == 0                              ? RowsAre::kNew
                 : fs::exists(folders.state() / kRestored) ? RowsAre::kRestored
                 : version < kSchemaVersion                ? RowsAre::kOlder
                                                           : RowsAre::kSigned);
  DoubtAfterLeap(*database, WallClock::now());
  (void)database->Checkpoint();  // so that the tables are not in the log of writes alone
  return database;
}

}  // namespace

int RestrictAccess(const fs::path& state) {
  constexpr mode_t kAll = 07777, kNotGiven = 0027;
  int num_changed = 0;
  struct stat status {};
  const auto is_open = [&](const fs::path& path) {
    return ::stat(path.c_str(), &status) == 0 && status.st_uid == ::geteuid() &&
           (status.st_mode & kNotGiven) != 0;
  };
  const auto restrict = [&](const fs::path& path) {
    if (is_open(path) && ::chmod(path.c_str(), status.st_mode & kAll & ~kNotGiven) == 0)
      ++num_changed;
  };
  const fs::path scans = ScanFolders(state).scans();
  if (is_open(state) || is_open(scans)) {  // these two last, so that an interrupted start goes on
    std::error_code error, ignored;
    fs::recursive_directory_iterator entry(state, fs::directory_options::skip_permission_denied,
                                           error);
    for (const fs::recursive_directory_iterator end; !error && entry != end; entry.increment(error))
      if (!entry->is_symlink(ignored) && entry->path() != scans) restrict(entry->path());
  }
  for (const char* name :
       {kDatabaseFile, "plumb.db-wal", "plumb.db-shm", "plumb.db-mark", "plumb.db-seals"})
    restrict(state / name);
  restrict(scans);
  restrict(state);
  return num_changed;
}

FolderLock::~FolderLock() {
  if (fd_ >= 0) ::close(fd_);
}

void FolderLock::Take(const fs::path& folder) {
  fd_ = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd_ >= 0 && ::flock(fd_, LOCK_EX | LOCK_NB) == 0) {
    struct statfs disk {};
    if (::fstatfs(fd_, &disk) == 0) {
      if (const Message why = WhyNoPlaceForStore(folder, static_cast<unsigned long>(disk.f_type));
          !why.empty())
        throw DiskRefused(why);
    }
    return lease_.Take(folder);
  }
  if (errno == EWOULDBLOCK) throw DatabaseBusy(say::store::FolderInUse(folder.string()));
  throw DiskRefused(say::store::FolderNotLocked(folder.string(), std::strerror(errno)));
}

Store::Store(const fs::path& folder, const StoreOptions& options)
    : folders(fs::absolute(folder)),
      database_(OpenForChanges(folders, options, lock_, recovery_), folders.state() / kDatabaseFile,
                Database::Access::kReadOnly),
      settings(database_, options.first_settings),
      integrity(database_, folders, options.look) {
  RecoverStore(*database_.ForChanges(), folders, options.look, recovery_);
  NoteRestore(folders.state(), *database_.ForChanges());
  NumberScansAbove(*database_.ForChanges(), LastScanNumber(folders));
  std::error_code error;
  for (const char* name : {kBackingUp, kRehearsing})  // of a backup that was cut off
    fs::remove_all(folders.state() / name, error);
  fs::create_directories(folders.scans(), error);
  if (error) throw DiskRefused(DescribeWriteError(folders.scans(), error.value()));
  scans_place_ = PlaceOf(folders.scans());
}

Store::Store(const fs::path& folder, const Settings& first_settings, ReadOnly)
    : folders(fs::absolute(folder)),
      database_(
          std::make_unique<Database>(folders.state() / kDatabaseFile, Database::Access::kFrozen),
          folders.state() / kDatabaseFile, Database::Access::kFrozen),
      settings(database_, first_settings),
      integrity(database_, folders, LookAt) {
  (void)patients.List();  // fails if the tables do not exist
}

std::unique_ptr<Store> Store::OpenReadable(const fs::path& folder, const Settings& first_settings) {
  return std::unique_ptr<Store>(new Store(folder, first_settings, ReadOnly{}));
}

void Store::CheckWritable() {
  if (const Message why = WhyOtherScans(); !why.empty()) throw DiskRefused(why);
  RequireWritable(folders);
  lock_.Renew();
}

/// A disk may come back under another device number; it is recognised by the newest scan on it.
Message Store::WhyOtherScans() {
  const FolderPlace now = PlaceOf(folders.scans());
  const std::lock_guard lock(place_mutex_);
  if (now == scans_place_) return {};
  try {
    const std::optional<std::string> newest = scans.NewestWithFiles();
    std::error_code error;
    if (newest && fs::exists(folders.Scan(*newest), error)) {
      scans_place_ = now;
      return {};
    }
  } catch (const IoError& error) {
    return error.message();
  }
  return say::store::OtherScans(folders.scans().string());
}

}  // namespace plumb
