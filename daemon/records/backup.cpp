#include "daemon/records/backup.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <map>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "daemon/records/database.hpp"
#include "daemon/records/file_copy.hpp"
#include "daemon/records/scan_files.hpp"
#include "daemon/records/schema.hpp"
#include "daemon/records/store_internal.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kFormat = 1;
constexpr const char* kAbout = "backup.json";
constexpr const char* kSums = "SHA256SUMS";
constexpr const char* kDatabase = "plumb.db";
constexpr const char* kScans = "scans";
/// What else of a state folder is kept; each where it exists.
constexpr std::array<const char*, 2> kOtherFolders = {"set-aside", "calibration"};
constexpr std::size_t kMaxAbout = std::size_t{16} << 20, kMaxSums = std::size_t{512} << 20;
constexpr std::size_t kMaxProblems = 1000;
constexpr const char* kRestoring = ".restore";

bool HasControlCharacters(const std::string& text) {
  return std::any_of(text.begin(), text.end(),
                     [](unsigned char c) { return c < 0x20 || c == 0x7F || c == '\\'; });
}

/// Regular files below a folder, relative to `top`, by path. @throws IoError
std::vector<std::string> FilesBelow(const fs::path& top, const fs::path& folder) {
  std::vector<std::string> files;
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, error);
  for (const fs::recursive_directory_iterator end; !error && entry != end; entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored)) files.push_back(entry->path().lexically_relative(top));
  }
  if (error && error != std::errc::no_such_file_or_directory)
    throw IoError(fmt::format("cannot list {}: {}", folder.string(), error.message()));
  std::sort(files.begin(), files.end());
  return files;
}

/// One backup that is being written.
class Writing {
 public:
  Writing(const fs::path& state, const fs::path& target, const std::stop_token& stop)
      : state_(state), output_(target, BackupOutput()), stop_(stop) {
    ::chmod(output_.path().c_str(), 0700);  // it holds patients' data and password hashes
  }

  BackupReport Write(Database& database) {
    database.CopyTo(output_.path() / kDatabase);
    Note(DigestOfFile(output_.path(), kDatabase, stop_));
    for (const auto& [scan, stored] : ScansIn(output_.path() / kDatabase)) AddScan(scan, stored);
    for (const char* folder : kOtherFolders) {
      for (const std::string& file : ListedOrTold(state_ / folder)) (void)Add(file);
    }
    WriteSums();
    output_.Commit();
    return report_;
  }

 private:
  using Stored = std::map<std::string, std::vector<FileDigest>>;

  /// As the copy of the database knows them, not as they have become meanwhile.
  static Stored ScansIn(const fs::path& copy) {
    Database database(copy, Database::Access::kFrozen);
    Stored scans;
    {
      Statement query = database.Prepare("SELECT id FROM scans WHERE has_folder = 1");
      while (query.Step()) scans[store::ScanId(query.Integer(0))];
    }
    Statement query =
        database.Prepare("SELECT scan_id, path, bytes, sha256 FROM scan_files ORDER BY path");
    while (query.Step()) {
      const auto scan = scans.find(store::ScanId(query.Integer(0)));
      if (scan == scans.end()) continue;
      scan->second.push_back({.path = query.Text(1),
                              .bytes = static_cast<std::uint64_t>(query.Integer(2)),
                              .sha256 = query.Text(3)});
    }
    return scans;
  }

  void AddScan(const std::string& scan, const std::vector<FileDigest>& stored) {
    const std::string folder = fmt::format("{}/{}", kScans, scan);
    std::map<std::string, std::string> found;
    for (const std::string& file : ListedOrTold(state_ / folder)) {
      if (const std::string digest = Add(file); !digest.empty())
        found[file.substr(folder.size() + 1)] = digest;
    }
    for (const FileDigest& file : stored) {
      if (file.path == kRecordingFolder) continue;  // its own check tells
      const auto copy = found.find(file.path);
      if (copy == found.end()) {
        Tell(fmt::format("scan {}: {} is missing", scan, file.path));
      } else if (copy->second != file.sha256) {
        Tell(fmt::format("scan {}: {} is not what was stored", scan, file.path));
      }
    }
    if (found.empty() && stored.empty()) Tell(fmt::format("scan {}: it has no files", scan));
    ++report_.scans;
  }

  std::vector<std::string> ListedOrTold(const fs::path& folder) {
    try {
      return FilesBelow(state_, folder);
    } catch (const IoError& error) {
      Tell(error.what());
      return {};
    }
  }

  /// Gives the digest, or nothing where the file cannot be read.
  std::string Add(const std::string& file) {
    CheckStop(stop_);
    if (HasControlCharacters(file)) {
      Tell(fmt::format("a file is left out, its name has control characters: {:?}", file));
      return {};
    }
    try {
      const FileDigest digest = CloneOrCopy(state_, output_.path(), file, stop_);
      Note(digest);
      return digest.sha256;
    } catch (const SourceUnreadable& error) {
      Tell(error.what());
      return {};
    }
  }

  void Note(const FileDigest& digest) {
    sums_ += fmt::format("{}  {}\n", digest.sha256, digest.path);
    ++report_.files;
    report_.bytes += digest.bytes;
  }

  void Tell(std::string problem) {
    if (report_.problems.size() < kMaxProblems) report_.problems.push_back(std::move(problem));
  }

  void WriteSums() {
    WriteWholeFile(output_.path() / kSums, sums_);
    const Json about = {
        {"format", kFormat},
        {"schema", kSchemaVersion},
        {"made_at", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)))},
        {"scans", report_.scans},
        {"files", report_.files},
        {"bytes", report_.bytes},
        {"sha256sums", DigestOfFile(output_.path(), kSums).sha256},
        {"problems", report_.problems}};
    WriteWholeFile(output_.path() / kAbout,
                   about.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  }

  fs::path state_;
  AtomicFolder output_;
  std::stop_token stop_;
  std::string sums_;
  BackupReport report_;
};

[[noreturn]] void FailBackup(const fs::path& backup, const std::string& why) {
  throw DataError(
      fmt::format("the backup {} cannot be used: {}; nothing was restored", backup.string(), why));
}

/// Only what a backup can hold: nothing outside, nothing unknown.
bool IsOurPath(const std::string& path) {
  if (path == kDatabase) return true;
  if (HasControlCharacters(path) || path.size() > 4000) return false;
  const fs::path parts(path);
  if (parts.lexically_normal().string() != path) return false;
  const std::string first = parts.begin()->string();
  const bool is_known = first == kScans || std::find(kOtherFolders.begin(), kOtherFolders.end(),
                                                     first) != kOtherFolders.end();
  return is_known && std::none_of(parts.begin(), parts.end(), [](const fs::path& part) {
           return part.empty() || part == "." || part == ".." || part == "/";
         });
}

std::vector<FileDigest> ReadSums(const fs::path& backup) {
  Json about;
  std::string text;
  try {
    about = Json::parse(ReadTextFile(backup / kAbout, kMaxAbout), nullptr, false);
    text = ReadTextFile(backup / kSums, kMaxSums);
  } catch (const DataError& error) {
    FailBackup(backup, error.what());
  }
  if (!about.is_object() || about.value("format", Json()) != kFormat)
    FailBackup(backup, fmt::format("{} is none of format {}", kAbout, kFormat));
  const Json schema = about.value("schema", Json());
  if (!schema.is_number_integer() || schema > kSchemaVersion)
    FailBackup(backup, "it was made by a newer Plumb: install that one first");
  if (about.value("sha256sums", Json()) != DigestOfFile(backup, kSums).sha256)
    FailBackup(backup, fmt::format("{} is not the one that was written", kSums));
  std::vector<FileDigest> files;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    begin = end + 1;
    constexpr std::size_t kHex = 64;
    if (line.size() < kHex + 3 || line.substr(kHex, 2) != "  " || !IsOurPath(line.substr(kHex + 2)))
      FailBackup(backup, fmt::format("{} has a line that is none of a backup: {:?}", kSums,
                                     line.substr(0, 120)));
    files.push_back({.path = line.substr(kHex + 2), .sha256 = line.substr(0, kHex)});
  }
  if (files.empty() || files.front().path != kDatabase)
    FailBackup(backup, fmt::format("it holds no {}", kDatabase));
  return files;
}

void VerifyBackup(const fs::path& backup, const std::vector<FileDigest>& files,
                  const std::stop_token& stop) {
  std::size_t wrong = 0;
  std::string first;
  for (const FileDigest& file : files) {
    std::string why;
    try {
      if (DigestOfFile(backup, file.path, stop).sha256 != file.sha256)
        why = file.path + " is not what was written";
    } catch (const IoError& error) {
      why = error.what();
    }
    if (why.empty()) continue;
    ++wrong;
    if (first.empty()) first = why;
  }
  if (wrong > 0)
    FailBackup(backup, fmt::format("{} of {} files are damaged ({})", wrong, files.size(), first));
  try {
    Database(backup / kDatabase, Database::Access::kFrozen).CheckIntegrity();
  } catch (const IoError& error) {
    FailBackup(backup, error.what());
  }
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

/// Who restores as root restores for the account that runs plumbd.
void GiveToOwnerOf(const fs::path& state, const fs::path& tree) {
  struct stat owner {};
  if (::geteuid() != 0 || ::stat(state.c_str(), &owner) != 0 || owner.st_uid == 0) return;
  const auto give = [&](const fs::path& path) {
    if (::lchown(path.c_str(), owner.st_uid, owner.st_gid) != 0)
      throw IoError(DescribeWriteError(path, errno));
  };
  give(tree);
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(tree))
    give(entry.path());
}

void MoveIn(const fs::path& made, const fs::path& state) {
  std::vector<std::string> names = {kScans, kOtherFolders[0], kOtherFolders[1], kDatabase};
  for (const std::string& name :
       names) {  // the database last: without it nothing is taken for whole
    std::error_code error;
    if (!fs::exists(made / name, error)) continue;
    if (::rename((made / name).c_str(), (state / name).c_str()) != 0)
      throw IoError(DescribeWriteError(state / name, errno));
  }
  SyncDisk(state);
  std::error_code ignored;
  fs::remove_all(made, ignored);
}

}  // namespace

OutputKind BackupOutput() {
  return {"backup", kAbout, {kAbout, kSums, kDatabase, kScans, kOtherFolders[0], kOtherFolders[1]}};
}

BackupReport WriteBackup(const fs::path& state, Database& database, const fs::path& target,
                         const std::stop_token& stop) {
  return Writing(state, target, stop).Write(database);
}

BackupReport BackUpStopped(const fs::path& state, const fs::path& target,
                           const std::stop_token& stop) {
  std::error_code error;
  if (!fs::is_regular_file(state / kDatabase, error)) {
    throw IoError(fmt::format("cannot back up {}: it holds no {}; name plumbd's state folder",
                              state.string(), kDatabase));
  }
  Database database(state / kDatabase, Database::Access::kReadWrite);
  Migrate(database);
  return WriteBackup(state, database, target, stop);
}

BackupReport RestoreBackup(const fs::path& backup, const fs::path& state,
                           const std::stop_token& stop) {
  RequireEmpty(state);
  const std::vector<FileDigest> files = ReadSums(backup);
  VerifyBackup(backup, files, stop);
  BackupReport report;
  const fs::path made = state / kRestoring;
  try {
    fs::remove_all(made);  // of a restore that was interrupted
    fs::create_directories(made / kScans);
    ::chmod(state.c_str(), 0750);
    for (const FileDigest& file : files) {
      CheckStop(stop);
      const FileDigest copy = Copy(backup, made, file.path, stop);
      if (copy.sha256 != file.sha256)
        FailBackup(backup, file.path + " changed while it was copied");
      ++report.files;
      report.bytes += copy.bytes;
    }
    for (const fs::directory_entry& scan : fs::directory_iterator(made / kScans))
      report.scans += scan.is_directory() ? 1 : 0;
    GiveToOwnerOf(state, made);
    SyncDisk(made);
    MoveIn(made, state);
  } catch (const fs::filesystem_error& error) {
    throw IoError(DescribeWriteError(state, error.code().value()));
  } catch (const SourceUnreadable& error) {
    FailBackup(backup, error.what());
  }
  return report;
}

}  // namespace plumb
