#include "daemon/records/store.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include <fmt/format.h>

#include "daemon/records/backup.hpp"
#include "daemon/records/retry_while_busy.hpp"
#include "daemon/records/schema.hpp"
#include "drivers/files/file_io.hpp"

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
  throw DiskRefused(fmt::format("cannot write to {}: {}; check the disk and make it writable",
                                folder.string(), std::strerror(reason)));
}

/// scans/ may be a disk of its own.
void RequireWritable(const ScanFolders& folders) {
  RequireWritable(folders.state());
  std::error_code ignored;
  if (fs::is_directory(folders.scans(), ignored)) RequireWritable(folders.scans());
}

/// A program that copies the database holds it for a while; another plumbd does not release it.
std::unique_ptr<Database> OpenChecked(const fs::path& state, const StoreOptions& options,
                                      bool& is_checked) {
  constexpr std::chrono::milliseconds kPause(500);
  return RetryWhileBusy(options.lock_wait, kPause, options.sleep, [&] {
    auto database = std::make_unique<Database>(state / kDatabaseFile, Database::Access::kReadWrite,
                                               options.busy_wait);
    is_checked = database->CheckIntegrity(options.check_limit);
    return database;
  });
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
  Migrate(*database);
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
  for (const char* name : {kDatabaseFile, "plumb.db-wal", "plumb.db-shm"}) restrict(state / name);
  restrict(scans);
  restrict(state);
  return num_changed;
}

FolderLock::~FolderLock() {
  if (fd_ >= 0) ::close(fd_);
}

void FolderLock::Take(const fs::path& folder) {
  fd_ = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd_ >= 0 && ::flock(fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    throw DatabaseBusy(
        fmt::format("another plumbd uses the folder {}: stop one of them, or give "
                    "each a state folder of its own",
                    folder.string()));
}

Store::Store(const fs::path& folder, const StoreOptions& options)
    : folders(fs::absolute(folder)),
      database_(OpenForChanges(folders, options, lock_, recovery_), folders.state() / kDatabaseFile,
                Database::Access::kReadOnly),
      settings(database_, options.first_settings),
      integrity(database_, folders, options.look) {
  RecoverStore(*database_.ForChanges(), folders, options.look, recovery_);
  NoteRestore(folders.state(), *database_.ForChanges());
  std::error_code error;
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
  if (const std::string why = WhyOtherScans(); !why.empty()) throw DiskRefused(why);
  RequireWritable(folders);
}

/// A disk may come back under another device number; it is recognised by the newest scan on it.
std::string Store::WhyOtherScans() {
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
    return error.what();
  }
  return fmt::format(
      "the folder of the scans {} is not the one that was opened: if its disk is not mounted any "
      "more, mount it again; if this is the right one, start plumbd again",
      folders.scans().string());
}

}  // namespace plumb
