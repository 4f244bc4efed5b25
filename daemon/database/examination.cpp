// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/examination.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string_view>
#include <vector>

#include "daemon/database/database_errors.hpp"
#include "daemon/database/database_mark.hpp"
#include "daemon/database/sealed_pages.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// The last schema whose databases have no checksums.
constexpr std::uint32_t kLastPlainSchema = 9;

/// A database with tables is changed through its log of writes only. SQLite would still undo what a
/// rollback journal beside it says, and so put pages of another time into it.
void RefuseJournal(const fs::path& database) {
  std::error_code missing;
  const fs::path journal = database.string() + "-journal";
  const std::uintmax_t bytes = fs::file_size(journal, missing);
  if (!missing && bytes > 0)
    throw DatabaseCorrupt(say::store::LogForeign(journal.string(), database.string()));
}

/// A file, opened for reading.
class BytesOf {
 public:
  explicit BytesOf(const fs::path& file) : fd_(::open(file.c_str(), O_RDONLY | O_CLOEXEC)) {}
  ~BytesOf() {
    if (fd_ >= 0) ::close(fd_);
  }
  BytesOf(const BytesOf&) = delete;
  BytesOf& operator=(const BytesOf&) = delete;
  [[nodiscard]] bool is_open() const { return fd_ >= 0; }
  [[nodiscard]] std::int64_t size() const { return ::lseek(fd_, 0, SEEK_END); }
  /// @return the number of bytes that could be read
  std::size_t ReadAt(std::int64_t offset, std::span<std::uint8_t> bytes) const {
    std::size_t got = 0;
    while (got < bytes.size()) {
      const ssize_t more = ::pread(fd_, bytes.data() + got, bytes.size() - got,
                                   offset + static_cast<std::int64_t>(got));
      if (more <= 0) break;
      got += static_cast<std::size_t>(more);
    }
    return got;
  }

 private:
  int fd_;
};

struct FirstPage {
  DatabaseKind kind = DatabaseKind::kNew;
  std::uint32_t changes = 0;
  /// The page or the end of the file is not as it was written. An interrupted checkpoint leaves
  /// that, and all that it was writing is in the log.
  std::optional<Message> torn = std::nullopt;
};

FirstPage ReadFirstPage(const fs::path& file) {
  const BytesOf bytes(file);
  // If the file exists but cannot be opened, SQLite will say why.
  if (!bytes.is_open())
    return {.kind = errno == ENOENT ? DatabaseKind::kNew : DatabaseKind::kPlain};
  std::array<std::uint8_t, kPageBytes> page{};
  const std::size_t got = bytes.ReadAt(0, page);
  if (got == 0) return {};
  constexpr std::string_view kMagic("SQLite format 3", 16);
  if (got < kMagic.size() || std::memcmp(page.data(), kMagic.data(), kMagic.size()) != 0)
    return {.kind = DatabaseKind::kPlain};
  if (page[kReservedAt] == 0) {
    // Perhaps the pages do have checksums, and only the byte that says so has been damaged.
    if (BigEndian32(page.data() + kUserVersionAt) > kLastPlainSchema || ReadMark(file))
      throw DatabaseCorrupt(say::store::DatabaseUnsealed(file.string()));
    return {.kind = DatabaseKind::kPlain};
  }
  FirstPage first{.kind = DatabaseKind::kSealed, .changes = BigEndian32(page.data() + kChangesAt)};
  // Without tables it may have been interrupted while it was created, which the journal undoes.
  if (BigEndian32(page.data() + kUserVersionAt) != 0) RefuseJournal(file);
  if (got < page.size() || page[kReservedAt] != kSealBytes || !IsSealed(page, 1)) {
    first.torn = say::store::PageDamaged(1, file.string());
  } else if (bytes.size() % static_cast<std::int64_t>(kPageBytes) != 0) {
    first.torn = say::store::DatabaseCut(file.string());
  }
  return first;
}

fs::path LogOf(const fs::path& database) { return database.string() + "-wal"; }

/// Numbers of the first and the last change in the log of writes.
struct LoggedChanges {
  std::uint32_t first = 0, last = 0;
};

/// Reads the frames of a log of writes in the order of the file. Only committed changes count.
/// @throws DatabaseCorrupt if a confirmed change follows a damaged frame
std::optional<LoggedChanges> ReadLog(const fs::path& file) {
  const BytesOf bytes(file);
  if (!bytes.is_open()) return std::nullopt;
  const std::int64_t size = bytes.size();
  std::array<std::uint8_t, kLogHeaderBytes> header{};
  if (size <= 0 || bytes.ReadAt(0, header) < header.size()) return std::nullopt;
  constexpr std::uint32_t kLittleEndianMagic = 0x377f0682, kFormat = 3007000;
  constexpr std::size_t kPageSizeAt = 8, kSaltsAt = 16, kHeaderSumAt = 24, kFrameSaltsAt = 8,
                        kFrameSumAt = 16, kCommitAt = 4, kSaltBytes = 8;
  constexpr std::uint32_t kLargestPage = 65536;
  LogSum sum;
  sum.Add(std::span(header).first(kHeaderSumAt));
  const std::uint32_t page_bytes = BigEndian32(header.data() + kPageSizeAt);
  if (BigEndian32(header.data()) != kLittleEndianMagic ||
      BigEndian32(header.data() + 4) != kFormat || page_bytes > kLargestPage || page_bytes < 512 ||
      page_bytes % 8 != 0 || !(sum == LogSum::At(header.data() + kHeaderSumAt))) {
    // A log that ends this early was still being started, so nothing in it has been confirmed.
    if (size <= static_cast<std::int64_t>(kLogHeaderBytes + kFrameHeaderBytes)) return std::nullopt;
    throw DatabaseCorrupt(say::store::LogDamaged(file.string(), 0));
  }
  std::optional<LoggedChanges> logged, committed;
  std::vector<std::uint8_t> frame(kFrameHeaderBytes + page_bytes);
  std::optional<std::int64_t> bad_at;
  for (std::int64_t at = kLogHeaderBytes; bytes.ReadAt(at, frame) == frame.size();
       at += static_cast<std::int64_t>(frame.size())) {
    const bool is_of_this =
        std::memcmp(frame.data() + kFrameSaltsAt, header.data() + kSaltsAt, kSaltBytes) == 0;
    const bool is_commit = BigEndian32(frame.data() + kCommitAt) != 0;
    if (!bad_at) {
      sum.Add(std::span(frame).first(kFrameSaltsAt));
      sum.Add(std::span(frame).subspan(kFrameHeaderBytes));
      if (!is_of_this || !(sum == LogSum::At(frame.data() + kFrameSumAt))) bad_at = at;
    }
    if (bad_at) {
      // After an unfinished change come the frames of an earlier log, with other salts. If a later
      // frame of this log has a commit mark, the change may never have been confirmed, but it
      // cannot be distinguished from one that was.
      if (is_of_this && is_commit && at > *bad_at)
        throw DatabaseCorrupt(say::store::LogDamaged(file.string(), *bad_at));
      continue;
    }
    if (BigEndian32(frame.data()) == 1) {
      const std::uint8_t* const page = frame.data() + kFrameHeaderBytes;
      const std::uint32_t changes = BigEndian32(page + kChangesAt);
      if (!logged) logged = LoggedChanges{.first = changes};
      logged->last = changes;
    }
    if (is_commit) committed = logged;
  }
  return committed;
}

}  // namespace

DatabaseKind KindOfDatabase(const fs::path& file) {
  const FirstPage first = ReadFirstPage(file);
  if (first.torn && !ReadLog(LogOf(file))) throw DatabaseCorrupt(*first.torn);
  return first.kind;
}

DatabaseKind ExamineDatabase(const fs::path& file) {
  const FirstPage first = ReadFirstPage(file);
  const fs::path log = LogOf(file);
  const std::optional<DatabaseMark> mark = ReadMark(file);
  if (first.kind == DatabaseKind::kNew) {
    std::error_code missing;
    const std::uintmax_t logged = fs::file_size(log, missing);
    if ((!missing && logged > 0) || mark)
      throw DatabaseCorrupt(say::store::DatabaseGone(file.string()));
    return first.kind;
  }
  const std::optional<LoggedChanges> logged = ReadLog(log);
  if (first.torn && !logged) throw DatabaseCorrupt(*first.torn);
  if (first.kind == DatabaseKind::kPlain) return first.kind;
  if (logged) {
    // Every change rewrites page 1, which holds the number of the change.
    const bool follows = first.changes + 1 >= logged->first && first.changes <= logged->last;
    if (!follows) throw DatabaseCorrupt(say::store::LogForeign(log.string(), file.string()));
  }
  if (!mark) return first.kind;
  const std::uint32_t last = logged ? logged->last : first.changes;
  // After a power cut the mark may lag behind, but by no more than this.
  constexpr std::uint32_t kMostUnmarked = 100'000;
  if (last > mark->changes && last - mark->changes > kMostUnmarked)
    throw DatabaseCorrupt(say::store::DatabaseForeign(file.string()));
  if (last < mark->changes)
    throw DatabaseCorrupt(say::store::DatabaseOlder(file.string(), last, mark->changes));
  return first.kind;
}

}  // namespace plumb
