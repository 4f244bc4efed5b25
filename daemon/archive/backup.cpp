// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/backup.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/utf8.hpp"
#include "daemon/archive/backup_parts.hpp"
#include "daemon/archive/rehearsal.hpp"
#include "daemon/archive/summed_folder.hpp"
#include "daemon/database/audit_store.hpp"
#include "daemon/database/database.hpp"
#include "daemon/database/scan_folders.hpp"
#include "daemon/database/schema.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/records/store.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "daemon/state_folder/restore_note.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/temporary.hpp"
#include "words/backup.hpp"
#include "words/output.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr int kBackupFormat = 1;
constexpr const char* kRestoring = ".restore";
/// The name of a display and the hash of its key. It is moved aside together with the database,
/// because only that database records that the key has been used.
constexpr const char* kProvisionedDisplay = "provisioned-display";

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
  Writing(const fs::path& state, const fs::path& target, const AgeRecipients& recipients,
          const std::stop_token& stop)
      : state_(state),
        target_(target),
        output_(target, kBackupKind, BackupOutput(), recipients, stop, Tap(recipients)) {}

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
            .whole_scans = std::move(whole_),
            .bytes = output_.bytes(),
            .problems = output_.problems(),
            .target = target_,
            .unrehearsed = unrehearsed_};
  }

 private:
  ArchiveTap Tap(const AgeRecipients& recipients) {
    if (recipients.empty()) return {};
    rehearsal_.emplace(state_);
    return {.take = [this](std::span<const std::uint8_t> bytes) { rehearsal_->Take(bytes); },
            .before_commit = [this] { unrehearsed_ = rehearsal_->End(); }};
  }

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
    bool is_whole = true;
    for (const std::string& file : ListedOrTold(state_ / folder)) {
      const std::string digest = output_.Add(state_, file);
      if (!digest.empty()) found[file.substr(folder.size() + 1)] = digest;
      is_whole = is_whole && !digest.empty();
    }
    for (const FileDigest& file : stored) {
      if (file.path == kRecordingFolder) continue;  // checked separately
      const auto copy = found.find(file.path);
      is_whole = is_whole && copy != found.end() && copy->second == file.sha256;
      if (copy == found.end()) {
        output_.Report(say::backup::ScanFileMissing(scan, file.path));
      } else if (copy->second != file.sha256) {
        output_.Report(say::backup::ScanFileChanged(scan, file.path));
      }
    }
    if (found.empty() && stored.empty()) output_.Report(say::backup::ScanWithoutFiles(scan));
    if (is_whole && !found.empty()) whole_.push_back(scan);
  }

  std::vector<std::string> ListedOrTold(const fs::path& folder) {
    try {
      return FilesBelow(state_, folder);
    } catch (const IoError& error) {
      output_.Report(error.message());
      return {};
    }
  }

  fs::path state_, target_;
  std::optional<Rehearsal> rehearsal_;
  Message unrehearsed_;
  SummedWriter output_;
  std::vector<std::string> whole_;
};

/// In there it would be a part of the next one, and go with what it is to replace.
void RequireOutside(const fs::path& state, const fs::path& target) {
  if (!IsBelow(fs::weakly_canonical(target), fs::weakly_canonical(state))) return;
  throw InvalidRequest(say::backup::InsideState(target.string(), state.string()));
}

void RequireEmpty(const fs::path& state) {
  std::error_code error;
  for (fs::directory_iterator entry(state, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name == kRestoring || name == "lost+found") continue;
    throw InvalidRequest(say::backup::RestoreNotEmpty(state.string(), name));
  }
  if (error && error != std::errc::no_such_file_or_directory)
    throw IoError(say::backup::NotListed(state.string(), error.message()));
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

/// The files that SQLite and the store keep beside a database. Without them it has lost its latest
/// changes, or the record that would reveal the loss.
constexpr std::array<const char*, 5> kBesideDatabase = {
    "plumb.db-wal", "plumb.db-shm", "plumb.db-journal", "plumb.db-mark", "plumb.db-seals"};

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
    if (error == EBUSY) throw IoError(say::backup::RestoreDiskOfItsOwn((state / name).string()));
    throw IoError(DescribeWriteError(state / name, error));
  }
  SyncWholeDisk(state);
  if (!fs::is_empty(aside)) return aside;
  fs::remove(aside);
  return {};
}

/// The folder, or what exists of the path to it.
fs::path ExistingPartOf(fs::path folder) {
  std::error_code error;
  folder = fs::absolute(folder);
  while (!fs::is_directory(folder, error) && folder.has_relative_path())
    folder = folder.parent_path();
  return folder;
}

void RequireDatabase(const SummedReader& reader) {
  if (reader.files().empty() || reader.files().front().path != kDatabaseFile)
    reader.Fail(say::backup::WithoutFile(kDatabaseFile));
}

/// Refuses a database that plumbd could not start with, or that does not belong to these files.
void CheckDatabase(const fs::path& copy, const SummedReader& reader) {
  try {
    Database database(copy, Database::Access::kFrozen);
    database.CheckIntegrity();
    RequireUsable(database);
    std::string last;
    for (const FileDigest& file : reader.files()) {
      const fs::path path(file.path);
      const std::string scan = std::next(path.begin())->string();
      if (*path.begin() != kScansFolder || scan == ScanFolders::kSetAside || scan == last) continue;
      if (!database.Has("SELECT 1 FROM scans WHERE id = ?", ParseId(scan)))
        reader.Fail(say::backup::ScanWithoutRow(scan));
      last = scan;
    }
  } catch (const IoError& error) {
    reader.Fail(error.message());
  }
}

}  // namespace

OutputKind BackupOutput() {
  std::vector<std::string_view> entries = {kAboutBackup, kSumsFile, kDatabaseFile, kScansFolder};
  entries.insert(entries.end(), kOtherFolders.begin(), kOtherFolders.end());
  return {say::output::Backup(), kAboutBackup, entries};
}

Message Described(const BackupReport& report, bool is_encrypted) {
  Message made = say::backup::LogMade(
      ValidUtf8(report.target.string()), static_cast<std::int64_t>(report.scans),
      static_cast<std::int64_t>(report.files), static_cast<std::int64_t>(report.bytes),
      static_cast<std::int64_t>(report.problems.size()));
  return is_encrypted ? say::backup::LogEncrypted(std::move(made)) : made;
}

BackupReport WriteBackup(const fs::path& state, Database& database, const fs::path& target,
                         const std::stop_token& stop, const AgeRecipients& recipients) {
  RequireOutside(state, target);
  return Writing(state, EncryptedName(target, recipients), recipients, stop).Write(database);
}

BackupReport BackUpStopped(const fs::path& state, const fs::path& target,
                           const std::stop_token& stop, const AgeRecipients& recipients) {
  std::error_code error;
  if (!fs::is_regular_file(state / kDatabaseFile, error)) {
    throw IoError(say::backup::NoStore(state.string(), kDatabaseFile));
  }
  Database database(state / kDatabaseFile, Database::Access::kReadWrite);
  Migrate(database);
  BackupReport report = WriteBackup(state, database, target, stop, recipients);
  Transaction transaction(database);
  AppendAuditEntry(database, kCommand, "backup.make", "", Described(report, !recipients.empty()));
  transaction.Commit();
  return report;
}

BackupReport VerifyBackup(const fs::path& backup, const std::stop_token& stop,
                          const BackupKeys& keys) {
  const TemporaryFolder scratch(fs::temp_directory_path(), "plumb-verify-");
  const SummedReader reader(backup, kBackupKind, keys, scratch.path(), stop);
  RequireDatabase(reader);
  reader.Verify(stop);
  BackupReport report;
  report.files = reader.files().size();
  std::set<std::string> scans;
  for (const FileDigest& file : reader.files()) {
    const fs::path path(file.path);
    if (*path.begin() == kScansFolder) scans.insert(*std::next(path.begin()));
  }
  scans.erase(ScanFolders::kSetAside);
  report.scans = scans.size();
  (void)reader.CopyTo(scratch.path(), reader.files().front(), stop);
  CheckDatabase(scratch.path() / kDatabaseFile, reader);
  return report;
}

BackupReport RestoreBackup(const fs::path& backup, const fs::path& state,
                           const std::stop_token& stop, const BackupKeys& keys) {
  RequireEmpty(state);
  const SummedReader reader(backup, kBackupKind, keys, ExistingPartOf(state), stop);
  RequireDatabase(reader);
  reader.Verify(stop);
  BackupReport report;
  const fs::path made = state / kRestoring;
  const bool is_new = !fs::exists(state);
  bool is_unpacked = false;
  try {
    fs::remove_all(made);  // left by an interrupted restore
    fs::create_directories(made / kScansFolder);
    ::chmod(state.c_str(), 0750);
    for (const FileDigest& file : reader.files()) {
      CheckStop(stop);
      report.bytes += reader.CopyTo(made, file, stop).bytes;
      if (report.files++ > 0) continue;
      CheckDatabase(made / kDatabaseFile, reader);  // it is the first
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
    is_unpacked = true;
    MoveIn(made, state);
  } catch (const std::exception& error) {
    // Nothing is left behind if the backup was incomplete or there was no room.
    std::error_code ignored;
    if (!is_unpacked) fs::remove_all(is_new ? state : made, ignored);
    if (const auto* system = dynamic_cast<const fs::filesystem_error*>(&error))
      throw IoError(DescribeWriteError(state, system->code().value()));
    throw;
  }
  return report;
}

BackupReport RestoreOver(const fs::path& backup, const fs::path& state, const std::stop_token& stop,
                         const BackupKeys& keys) {
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
      report = RestoreBackup(backup, made, stop, keys);
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
      throw IoError(say::backup::RestoreRepeat(error.message(), report.replaced.string()));
    }
    return report;
  } catch (const fs::filesystem_error& error) {
    throw IoError(DescribeWriteError(state, error.code().value()));
  }
}

}  // namespace plumb
