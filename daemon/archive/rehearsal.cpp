// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/rehearsal.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "daemon/archive/backup_parts.hpp"
#include "daemon/archive/summed_folder.hpp"
#include "daemon/archive/tar_file.hpp"
#include "daemon/database/scan_folders.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/records/store.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "daemon/state_folder/restore_note.hpp"
#include "drivers/files/file_io.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMostUnpacked = std::uint64_t{2} << 30;
constexpr std::size_t kMaxOwnText = std::size_t{512} << 20;  // the sums of all files
constexpr int kBadInputCode = 3;                             // of `plumb`: a DataError

fs::path PlumbProgram() {
  std::error_code error;
  const fs::path beside = fs::read_symlink("/proc/self/exe", error).parent_path() / "plumb";
  return ::access(beside.c_str(), X_OK) == 0 ? beside : ProgramInPath("plumb");
}

/// A file that has its length and no content, for want of room.
void MakeEmpty(const fs::path& file, std::uint64_t bytes) {
  fs::create_directories(file.parent_path());
  const Descriptor made(::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (made.get() < 0 || ::ftruncate(made.get(), static_cast<off_t>(bytes)) != 0)
    throw DiskRefused(DescribeWriteError(file, errno));
}

/// What came out of the stream.
class Unpacked {
 public:
  explicit Unpacked(fs::path scratch) : scratch_(std::move(scratch)) {
    room_ = std::min(kMostUnpacked, static_cast<std::uint64_t>(fs::space(scratch_).available) / 2);
  }

  /// Takes the next file. @return what takes its content
  TarStreamTake Begin(const std::string& path, std::uint64_t bytes) {
    EndFile();
    if (path == kSumsFile || path == kAboutBackup) {
      std::string& text = texts_[path];
      return [&text](std::span<const std::uint8_t> piece) {
        if (text.size() + piece.size() > kMaxOwnText) throw DataError(say::backup::TarTooMany());
        text.append(piece.begin(), piece.end());
      };
    }
    if (!BackupMayHold(path)) throw DataError(say::backup::WrongEntry(path, "backup"));
    if (bytes > room_ && path == kDatabaseFile)
      throw DiskRefused(DescribeWriteError(scratch_ / path, ENOSPC));
    path_ = path;
    hash_ = Sha256();
    if (bytes <= room_) {
      room_ -= bytes;
      writer_.emplace(scratch_, path);
    } else {
      MakeEmpty(scratch_ / path, bytes);
    }
    return [this](std::span<const std::uint8_t> piece) {
      if (writer_) return writer_->Write(piece);
      hash_.Add(piece.data(), piece.size());
    };
  }

  void EndFile() {
    if (path_.empty()) return;
    sums_[path_] = writer_ ? writer_->Close().sha256 : hash_.Hex();
    writer_.reset();
    path_.clear();
  }

  /// Compares the sums, and returns what the backup says about itself.
  /// @throws DataError naming the first difference
  [[nodiscard]] Json Compared() const {
    const auto text = [&](const char* name) {
      const auto found = texts_.find(name);
      if (found == texts_.end()) throw DataError(say::backup::WithoutFile(name));
      return found->second;
    };
    std::string listed;
    for (const auto& [path, sum] : sums_) listed += fmt::format("{}  {}\n", sum, path);
    std::string sums = text(kSumsFile);
    const Json about = ParseBoundedJsonOrNothing<Json>(text(kAboutBackup));
    if (!about.is_object() || about.value("sha256sums", Json()) != Sha256Of(sums) ||
        Sorted(std::move(sums)) != Sorted(std::move(listed)))
      throw DataError(say::backup::SumsChanged(kSumsFile));
    return about;
  }

  [[nodiscard]] const std::map<std::string, std::string>& sums() const { return sums_; }

 private:
  static std::vector<std::string> Sorted(std::string text) {
    std::vector<std::string> lines;
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t end = std::min(text.find('\n', begin), text.size());
      lines.push_back(text.substr(begin, end - begin));
      begin = end + 1;
    }
    std::sort(lines.begin(), lines.end());
    return lines;
  }

  fs::path scratch_;
  std::uint64_t room_ = 0;
  std::string path_;
  std::optional<DigestingWriter> writer_;
  Sha256 hash_;
  std::map<std::string, std::string> sums_, texts_;
};

/// Every file that the database lists has come, as it was when it was stored.
void CompareRows(Database& database, const std::map<std::string, std::string>& sums) {
  Statement row = database.Prepare(
      "SELECT scan_id, path, scan_files.sha256 FROM scan_files JOIN scans ON scans.id = scan_id "
      "WHERE has_folder = 1");
  while (row.Step()) {
    const std::string scan = ScanId(row.Integer(0)), path = row.Text(1);
    if (path == kRecordingFolder) continue;  // the sum of a folder
    const auto found = sums.find(fmt::format("{}/{}/{}", kScansFolder, scan, path));
    if (found == sums.end()) throw DataError(say::backup::ScanFileMissing(scan, path));
    if (found->second != row.Text(2)) throw DataError(say::backup::ScanFileChanged(scan, path));
  }
}

void OpenAsAtStart(const fs::path& scratch, bool is_whole, const Unpacked& unpacked) {
  try {
    // What is missing from one that is not whole has been reported.
    if (is_whole) {
      Database database(scratch / kDatabaseFile, Database::Access::kFrozen);
      CompareRows(database, unpacked.sums());
    }
    // As after a restore: a backup has no key of the rows' digests.
    WriteWholeFile(scratch / kRestored,
                   nlohmann::ordered_json{
                       {"backup", "rehearsal"}, {"sha256", ""}, {"scans", 0}, {"time", StoredNow()}}
                       .dump());
    const Store store(scratch);
    if (!is_whole) return;
    const RecoveryReport& found = store.recovery();
    if (found.lost_scans > 0 || found.foreign_folders > 0)
      throw DataError(say::backup::RehearsedWithoutScans(found.lost_scans + found.foreign_folders));
  } catch (const DiskRefused&) {
    throw;
  } catch (const IoError& error) {
    throw DataError(error.message());
  }
}

}  // namespace

Rehearsal::Rehearsal(const fs::path& state) : scratch_(state / kRehearsing) {
  constexpr timeval kLongestWait{.tv_sec = 120, .tv_usec = 0};
  try {
    const fs::path program = PlumbProgram();
    std::error_code error;
    fs::remove_all(scratch_, error);  // left by an interrupted one
    if (!fs::create_directory(scratch_, error))
      throw IoError(DescribeWriteError(scratch_, error.value()));
    ::chmod(scratch_.c_str(), 0700);
    Channel channel = MakeChannel(program.string());
    (void)::setsockopt(channel.ours.get(), SOL_SOCKET, SO_SNDTIMEO, &kLongestWait,
                       sizeof(kLongestWait));
    const Descriptor nothing(::open("/dev/null", O_WRONLY | O_CLOEXEC));
    process_.emplace(
        program,
        std::vector<std::string>{"restore", "-", "--rehearse", "--state", scratch_.string()},
        channel.its.get(), nothing.get());
    input_.emplace(std::move(channel.ours));
  } catch (const IoError& error) {
    why_not_ = error.message();
  }
}

Rehearsal::~Rehearsal() {
  process_.reset();  // it writes there
  std::error_code ignored;
  fs::remove_all(scratch_, ignored);
}

void Rehearsal::Take(std::span<const std::uint8_t> bytes) {
  while (input_ && !bytes.empty()) {
    const ssize_t sent = ::send(input_->get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) {
      if (errno == EAGAIN) {  // it hangs, and is killed
        process_.reset();
        why_not_ = Message::Verbatim(std::strerror(ETIMEDOUT));
      }
      input_.reset();  // if it has ended, End() says why
      return;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
}

Message Rehearsal::End() {
  input_.reset();
  if (!process_) return why_not_;
  const std::string said = process_->Wait();
  if (said.empty()) return {};
  if (process_->exit_code() == kBadInputCode) throw DataError(say::backup::RehearsalFailed(said));
  return Message::Verbatim(said);
}

void RehearseRestore(int input, const fs::path& scratch, const std::stop_token& stop) {
  if (!fs::is_empty(scratch))
    throw InvalidRequest(say::backup::RestoreNotEmpty(scratch.string(), ""));
  Unpacked unpacked(scratch);
  ReadTarStream(input, stop, [&](const std::string& path, std::uint64_t bytes) {
    return unpacked.Begin(path, bytes);
  });
  unpacked.EndFile();
  // The writer of the backup waits for this process from now on.
  constexpr unsigned kLongest_s = 900;
  (void)::alarm(kLongest_s);
  const Json about = unpacked.Compared();
  OpenAsAtStart(scratch, about.value("problems", Json::array()).empty(), unpacked);
  (void)::alarm(0);
}

}  // namespace plumb
