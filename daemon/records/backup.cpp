#include "daemon/records/backup.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <map>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/utf8.hpp"
#include "daemon/records/audit_store.hpp"
#include "daemon/records/database.hpp"
#include "daemon/records/file_copy.hpp"
#include "daemon/records/scan_files.hpp"
#include "daemon/records/scan_folders.hpp"
#include "daemon/records/schema.hpp"
#include "daemon/records/store.hpp"
#include "daemon/records/stored_values.hpp"
#include "daemon/records/summed_folder.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr int kBackupFormat = 1;
constexpr const char* kAboutBackup = "backup.json";
/// The other parts of a state folder that are copied if they exist.
constexpr std::array<const char*, 4> kOtherFolders = {ScanFolders::kSetAside, "calibration",
                                                      "imports", "sensor-profiles"};
constexpr const char* kRestoring = ".restore";
constexpr const char* kRestoringOver = ".recovery";
constexpr const char* kBackingUp = ".backup";
/// In a restored state folder, until its audit log has the entry.
constexpr const char* kRestored = "restored.json";
/// The name of a display and the hash of its key. It is moved aside together with the database,
/// because only that database records that the key has been used.
constexpr const char* kProvisionedDisplay = "provisioned-display";

/// True for the paths that a backup can contain: nothing outside it, nothing unknown.
bool BackupMayHold(const std::string& path) {
  const std::string first = fs::path(path).begin()->string();
  return path == kDatabaseFile ||
         (first != path &&
          (first == kScansFolder ||
           std::find(kOtherFolders.begin(), kOtherFolders.end(), first) != kOtherFolders.end()));
}

const SummedKind kBackupKind{.name = "backup",
                             .about_file = kAboutBackup,
                             .format = kBackupFormat,
                             .may_hold = BackupMayHold};

/// A copy of the database beside the store, because the folder of an encrypted backup must never
/// contain a plain one.
class DatabaseCopy {
 public:
  DatabaseCopy(const fs::path& state, Database& database) : folder_(state / kBackingUp) {
    std::error_code error;
    fs::remove_all(folder_, error);  // left by an interrupted backup
    fs::create_directory(folder_, error);
    if (error) throw IoError(DescribeWriteError(folder_, error.value()));
    ::chmod(folder_.c_str(), 0700);
    try {
      database.CopyTo(folder_ / kDatabaseFile);
    } catch (...) {
      fs::remove_all(folder_, error);
      throw;
    }
  }
  ~DatabaseCopy() {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  DatabaseCopy(const DatabaseCopy&) = delete;
  DatabaseCopy& operator=(const DatabaseCopy&) = delete;
  [[nodiscard]] const fs::path& folder() const { return folder_; }

 private:
  fs::path folder_;
};

/// One backup that is being written.
class Writing {
 public:
  Writing(const fs::path& state, const fs::path& target, const BackupSecret* secret,
          const std::stop_token& stop)
      : state_(state), output_(target, kBackupKind, BackupOutput(), secret, stop) {}

  BackupReport Write(Database& database) {
    const DatabaseCopy copy(state_, database);
    output_.AddOwn(copy.folder(), kDatabaseFile);
    std::size_t scans = 0;
    for (const auto& [scan, stored] : ScansIn(copy.folder() / kDatabaseFile)) {
      AddScan(scan, stored);
      ++scans;
    }
    for (const char* folder : kOtherFolders) {
      for (const std::string& file : ListedOrTold(state_ / folder)) (void)output_.Add(state_, file);
    }
    const fs::path aside_with_scans = state_ / kScansFolder / ScanFolders::kSetAside;
    for (const std::string& file : ListedOrTold(aside_with_scans)) (void)output_.Add(state_, file);
    output_.Commit({{"scans", scans}});
    return {.scans = scans,
            .files = output_.files(),
            .bytes = output_.bytes(),
            .problems = output_.problems()};
  }

 private:
  using Stored = std::map<std::string, std::vector<FileDigest>>;

  /// As stored in the copy of the database, not as they have changed since.
  static Stored ScansIn(const fs::path& copy) {
    Database database(copy, Database::Access::kFrozen);
    Stored scans;
    {
      Statement query = database.Prepare("SELECT id FROM scans WHERE has_folder = 1");
      while (query.Step()) scans[ScanId(query.Integer(0))];
    }
    Statement query =
        database.Prepare("SELECT scan_id, path, bytes, sha256 FROM scan_files ORDER BY path");
    while (query.Step()) {
      const auto scan = scans.find(ScanId(query.Integer(0)));
      if (scan == scans.end()) continue;
      scan->second.push_back({.path = query.Text(1),
                              .bytes = static_cast<std::uint64_t>(query.Integer(2)),
                              .sha256 = query.Text(3)});
    }
    return scans;
  }

  void AddScan(const std::string& scan, const std::vector<FileDigest>& stored) {
    const std::string folder = fmt::format("{}/{}", kScansFolder, scan);
    std::map<std::string, std::string> found;
    for (const std::string& file : ListedOrTold(state_ / folder)) {
      if (const std::string digest = output_.Add(state_, file); !digest.empty())
        found[file.substr(folder.size() + 1)] = digest;
    }
    for (const FileDigest& file : stored) {
      if (file.path == kRecordingFolder) continue;  // checked separately
      const auto copy = found.find(file.path);
      if (copy == found.end()) {
        output_.Report(fmt::format("scan {}: {} is missing", scan, file.path));
      } else if (copy->second != file.sha256) {
        output_.Report(fmt::format("scan {}: {} is not what was stored", scan, file.path));
      }
    }
    if (found.empty() && stored.empty())
      output_.Report(fmt::format("scan {}: it has no files", scan));
  }

  std::vector<std::string> ListedOrTold(const fs::path& folder) {
    try {
      return FilesBelow(state_, folder);
    } catch (const IoError& error) {
      output_.Report(error.what());
      return {};
    }
  }

  fs::path state_;
  SummedWriter output_;
};

/// In there it would be a part of the next one, and go with what it is to replace.
void RequireOutside(const fs::path& state, const fs::path& target) {
  if (!IsBelow(fs::weakly_canonical(target), fs::weakly_canonical(state))) return;
  throw std::invalid_argument(
      fmt::format("a backup cannot be made at {}: that is inside the state folder {} itself; name "
                  "a folder on another disk",
                  target.string(), state.string()));
}

void RequireEmpty(const fs::path& state) {
  std::error_code error;
  for (fs::directory_iterator entry(state, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name == kRestoring || name == "lost+found") continue;
    throw std::invalid_argument(
        fmt::format("cannot restore into {}: it holds {}; a backup is restored into an empty state "
                    "folder only. Stop plumbd and move the folder's content away first",
                    state.string(), name));
  }
  if (error && error != std::errc::no_such_file_or_directory)
    throw IoError(fmt::format("cannot list {}: {}", state.string(), error.message()));
}

void MoveIn(const fs::path& made, const fs::path& state) {
  std::vector<std::string> names = {kRestored, kScansFolder};
  names.insert(names.end(), kOtherFolders.begin(), kOtherFolders.end());
  names.emplace_back(kDatabaseFile);
  for (const std::string& name :
       names) {  // the database last, because a folder without it does not count as complete
    std::error_code error;
    if (!fs::exists(made / name, error)) continue;
    if (::rename((made / name).c_str(), (state / name).c_str()) != 0)
      throw IoError(DescribeWriteError(state / name, errno));
  }
  SyncWholeDisk(state);
  std::error_code ignored;
  fs::remove_all(made, ignored);
}

/// What SQLite keeps beside a database. A database without them has lost its last changes.
constexpr std::array<const char*, 3> kBesideDatabase = {"plumb.db-wal", "plumb.db-shm",
                                                        "plumb.db-journal"};

/// Moves the database. At every moment it has the files that belong to it: these are in both
/// folders until it has moved.
void MoveDatabase(const fs::path& from, const fs::path& to) {
  const auto drop = [](const fs::path& folder) {
    for (const char* name : kBesideDatabase) ::unlink((folder / name).c_str());
  };
  for (const char* name : kBesideDatabase) {
    if (::link((from / name).c_str(), (to / name).c_str()) == 0 || errno == ENOENT) continue;
    const int error = errno;
    drop(to);
    throw IoError(DescribeWriteError(to / name, error));
  }
  try {
    SyncWholeDisk(to);
  } catch (const IoError&) {
    drop(to);
    throw;
  }
  if (::rename((from / kDatabaseFile).c_str(), (to / kDatabaseFile).c_str()) != 0 &&
      errno != ENOENT) {
    const int error = errno;
    drop(to);
    throw IoError(DescribeWriteError(to / kDatabaseFile, error));
  }
  SyncWholeDisk(to);
  drop(from);
}

/// Moves everything that a restore replaces to a new folder. The database goes first: without it a
/// start is safe mode (IsRestoreInterrupted()).
fs::path MoveOldAside(const fs::path& state) {
  fs::path aside;
  for (int n = 1; aside.empty() || fs::exists(fs::symlink_status(aside)); ++n)
    aside = state / fmt::format("before-restore-{}", n);
  fs::create_directory(aside);
  GiveToOwnerOf(state, aside);
  std::vector<std::string> names = {kRestored, kProvisionedDisplay, kScansFolder};
  names.insert(names.end(), kOtherFolders.begin(), kOtherFolders.end());
  std::vector<std::string> moved;
  try {
    MoveDatabase(state, aside);
  } catch (const IoError&) {
    ::rmdir(aside.c_str());
    throw;
  }
  for (const std::string& name : names) {
    if (!fs::exists(fs::symlink_status(state / name))) continue;
    if (::rename((state / name).c_str(), (aside / name).c_str()) == 0) {
      moved.push_back(name);
      continue;
    }
    const int error = errno;
    for (const std::string& back : moved)
      (void)::rename((aside / back).c_str(), (state / back).c_str());
    MoveDatabase(aside, state);
    ::rmdir(aside.c_str());
    if (error == EBUSY)
      throw IoError(fmt::format("cannot restore over {}: it is a disk of its own; unmount it first",
                                (state / name).string()));
    throw IoError(DescribeWriteError(state / name, error));
  }
  SyncWholeDisk(state);
  if (!fs::is_empty(aside)) return aside;
  fs::remove(aside);
  return {};
}

}  // namespace

OutputKind BackupOutput() {
  std::vector<std::string_view> entries = {kAboutBackup, kSumsFile, kDatabaseFile, kScansFolder};
  entries.insert(entries.end(), kOtherFolders.begin(), kOtherFolders.end());
  return {"backup", kAboutBackup, entries};
}

std::string Described(const fs::path& target, const BackupReport& report, bool is_encrypted) {
  return fmt::format("{}: {} scans, {} files, {} bytes, {} problems{}", ValidUtf8(target.string()),
                     report.scans, report.files, report.bytes, report.problems.size(),
                     is_encrypted ? ", encrypted" : "");
}

BackupReport WriteBackup(const fs::path& state, Database& database, const fs::path& target,
                         const std::stop_token& stop, const BackupSecret* secret) {
  RequireOutside(state, target);
  return Writing(state, target, secret, stop).Write(database);
}

BackupReport BackUpStopped(const fs::path& state, const fs::path& target,
                           const std::stop_token& stop, const BackupSecret* secret) {
  std::error_code error;
  if (!fs::is_regular_file(state / kDatabaseFile, error)) {
    throw IoError(fmt::format("cannot back up {}: it holds no {}; name plumbd's state folder",
                              state.string(), kDatabaseFile));
  }
  Database database(state / kDatabaseFile, Database::Access::kReadWrite);
  Migrate(database);
  BackupReport report = WriteBackup(state, database, target, stop, secret);
  Transaction transaction(database);
  AppendAuditEntry(database, kCommand, "backup.make", "",
                   Described(target, report, secret != nullptr));
  transaction.Commit();
  return report;
}

BackupReport RestoreBackup(const fs::path& backup, const fs::path& state,
                           const std::stop_token& stop, const BackupSecret* secret) {
  RequireEmpty(state);
  const SummedReader reader(backup, kBackupKind, secret);
  if (reader.files().empty() || reader.files().front().path != kDatabaseFile)
    reader.Fail(fmt::format("it holds no {}", kDatabaseFile));
  reader.Verify(stop);
  BackupReport report;
  const fs::path made = state / kRestoring;
  const bool is_new = !fs::exists(state);
  try {
    fs::remove_all(made);  // left by an interrupted restore
    fs::create_directories(made / kScansFolder);
    ::chmod(state.c_str(), 0750);
    for (const FileDigest& file : reader.files()) {
      CheckStop(stop);
      report.bytes += reader.CopyTo(made, file, stop).bytes;
      if (report.files++ > 0) continue;
      try {  // the database is the first
        Database(made / kDatabaseFile, Database::Access::kFrozen).CheckIntegrity();
      } catch (const IoError& error) {
        reader.Fail(error.what());
      }
    }
    for (const fs::directory_entry& scan : fs::directory_iterator(made / kScansFolder))
      report.scans += scan.is_directory() ? 1 : 0;
    WriteWholeFile(made / kRestored, nlohmann::ordered_json{{"backup", ValidUtf8(backup.string())},
                                                            {"sha256", reader.digest()},
                                                            {"scans", report.scans},
                                                            {"time", StoredNow()}}
                                         .dump(2));
    GiveToOwnerOf(state, made);
    SyncWholeDisk(made);
    MoveIn(made, state);
  } catch (const fs::filesystem_error& error) {
    throw IoError(DescribeWriteError(state, error.code().value()));
  } catch (const DataError&) {  // nothing remains of a backup that was not complete
    std::error_code ignored;
    fs::remove_all(is_new ? state : made, ignored);
    throw;
  }
  return report;
}

BackupReport RestoreOver(const fs::path& backup, const fs::path& state, const std::stop_token& stop,
                         const BackupSecret* secret) {
  FolderLock lock;
  lock.Take(state);
  const fs::path made = state / kRestoringOver;
  try {
    BackupReport report;
    bool is_unpacked = false;
    try {
      fs::remove_all(made);  // left by an interrupted one
      fs::create_directory(made);
      GiveToOwnerOf(state, made);
      report = RestoreBackup(backup, made, stop, secret);
      is_unpacked = true;
      report.replaced = MoveOldAside(state);
    } catch (...) {
      // What is stored is as it was. If it could not be moved back, the unpacked backup has to
      // stay: without both, the next start would begin with an empty store
      // (IsRestoreInterrupted()).
      std::error_code ignored;
      if (!is_unpacked || fs::exists(state / kDatabaseFile, ignored)) fs::remove_all(made, ignored);
      throw;
    }
    try {
      MoveIn(made, state);
    } catch (const IoError& error) {
      if (report.replaced.empty()) throw;
      throw IoError(fmt::format("{}. What was stored before is in {}; repeat the restore",
                                error.what(), report.replaced.string()));
    }
    return report;
  } catch (const fs::filesystem_error& error) {
    throw IoError(DescribeWriteError(state, error.code().value()));
  }
}

bool IsRestoreInterrupted(const fs::path& state) {
  std::error_code ignored;
  return fs::exists(state / kRestoringOver / kDatabaseFile, ignored);
}

void NoteRestore(const fs::path& state, Database& database) {
  const fs::path note = state / kRestored;
  std::error_code error;
  if (!fs::exists(note, error)) return;
  std::string detail;
  try {
    constexpr std::size_t kLongest = 1U << 16U;
    const nlohmann::json about = nlohmann::json::parse(ReadTextFile(note, kLongest));
    detail = fmt::format("{}: {} scans, sha256 {}, restored at {:%F %T} UTC",
                         about.at("backup").get<std::string>(), about.at("scans").get<int>(),
                         about.at("sha256").get<std::string>(),
                         fmt::gmtime(std::chrono::system_clock::to_time_t(
                             FromStored(about.at("time").get<std::int64_t>()))));
  } catch (const std::exception& unreadable) {  // that it was restored is known in any case
    detail = fmt::format("the note about it cannot be read: {}", unreadable.what());
  }
  Transaction transaction(database);
  AppendAuditEntry(database, kSelf, "backup.restore", "", detail);
  transaction.Commit();
  fs::remove(note, error);  // if that fails, the next start adds the entry once more
}

}  // namespace plumb
