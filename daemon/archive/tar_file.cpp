// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/tar_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <set>
#include <utility>
#include <vector>

#include <archive.h>
#include <archive_entry.h>
#include <fmt/format.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "drivers/files/file_io.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kTarPiece = std::size_t{256} << 10, kMaxPath = 4000;
/// What the names of one archive may take of the memory.
constexpr std::size_t kMaxFiles = 500'000, kMaxNames = std::size_t{64} << 20;

struct FreeReader {
  void operator()(archive* reader) const { ::archive_read_free(reader); }
};
using Reader = std::unique_ptr<archive, FreeReader>;

struct FreeEntry {
  void operator()(archive_entry* entry) const { ::archive_entry_free(entry); }
};

Message ReasonOf(archive* handle) {
  const char* text = handle != nullptr ? ::archive_error_string(handle) : nullptr;
  return text != nullptr ? Message::Verbatim(text) : say::backup::ReasonUnknown();
}

/// Tar only: a format or a compression more is one more way in.
Reader OpenAt(int fd, std::int64_t position) {
  Reader reader(::archive_read_new());
  if (!reader || ::archive_read_support_format_tar(reader.get()) != ARCHIVE_OK)
    throw IoError(say::backup::LibarchiveUnusable());
  if (::lseek(fd, position, SEEK_SET) != position ||
      ::archive_read_open_fd(reader.get(), fd, kTarPiece) != ARCHIVE_OK)
    throw SourceUnreadable(say::backup::TarNotOpened(ReasonOf(reader.get())));
  return reader;
}

/// The name of a regular file. @throws DataError for everything else
std::string NameOf(archive_entry* entry) {
  const char* text = ::archive_entry_pathname(entry);
  const std::string name = text != nullptr ? text : "";
  const std::string shown = name.substr(0, 120);
  if (!IsPlainPath(name)) throw DataError(say::backup::TarPath(fmt::format("{:?}", shown)));
  if (::archive_entry_filetype(entry) != AE_IFREG || ::archive_entry_hardlink(entry) != nullptr ||
      ::archive_entry_symlink(entry) != nullptr || ::archive_entry_sparse_count(entry) != 0)
    throw DataError(say::backup::TarNoPlainFile(shown));
  return name;
}

}  // namespace

bool IsTarName(const fs::path& path) {
  return path.extension() == ".tar" || path.extension() == ".age";
}

bool IsPlainPath(const std::string& path) {
  const bool has_control = std::any_of(
      path.begin(), path.end(), [](unsigned char c) { return c < 0x20 || c == 0x7F || c == '\\'; });
  if (has_control || path.empty() || path.size() > kMaxPath) return false;
  const fs::path parts(path);
  return parts.lexically_normal().string() == path &&
         std::none_of(parts.begin(), parts.end(), [](const fs::path& part) {
           return part.empty() || part == "." || part == ".." || part == "/";
         });
}

void ReadTarStream(
    int input, const std::stop_token& stop,
    const std::function<TarStreamTake(const std::string& path, std::uint64_t bytes)>& begin) {
  const Reader reader(::archive_read_new());
  const auto fail = [&] { throw DataError(say::backup::NoTar(ReasonOf(reader.get()))); };
  if (!reader || ::archive_read_support_format_tar(reader.get()) != ARCHIVE_OK ||
      ::archive_read_open_fd(reader.get(), input, kTarPiece) != ARCHIVE_OK)
    fail();
  std::vector<std::uint8_t> piece(kTarPiece);
  std::set<std::string> names;
  for (archive_entry* entry = nullptr;;) {
    const int result = ::archive_read_next_header(reader.get(), &entry);
    if (result == ARCHIVE_EOF) break;
    if (result != ARCHIVE_OK) fail();
    const std::string name = NameOf(entry);
    if (names.size() >= kMaxFiles) throw DataError(say::backup::TarTooMany());
    if (!names.insert(name).second) throw DataError(say::backup::TarTwice(name));
    const std::int64_t size = ::archive_entry_size(entry);
    if (size < 0) throw DataError(say::backup::TarCut(name));
    const TarStreamTake take = begin(name, static_cast<std::uint64_t>(size));
    for (la_ssize_t count = 1; count > 0;) {
      CheckStop(stop);
      count = ::archive_read_data(reader.get(), piece.data(), piece.size());
      if (count < 0) fail();
      take({piece.data(), static_cast<std::size_t>(count)});
    }
  }
  while (::read(input, piece.data(), piece.size()) > 0) {  // so that the writer gets rid of it
  }
}

void TarWriter::Sink::Take(std::span<const std::uint8_t> bytes) {
  if (is_closed || error) return;
  try {
    if (tee) tee(bytes);
    if (age) return age->Write(bytes);
    WriteAll(*fd, {reinterpret_cast<const char*>(bytes.data()), bytes.size()}, file);
  } catch (const IoError& failure) {
    error = failure.message();
  }
}

TarWriter::TarWriter(fs::path file, const AgeRecipients& recipients, TarStreamTake tee)
    : sink_{.file = std::move(file), .fd = nullptr, .age = nullptr, .tee = std::move(tee)} {
  sink_.fd = std::make_unique<Descriptor>(
      ::open(sink_.file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (sink_.fd->get() < 0) throw IoError(DescribeWriteError(sink_.file, errno));
  if (!recipients.empty()) sink_.age = std::make_unique<AgeWriter>(recipients, sink_.fd->get());
  archive_ = ::archive_write_new();
  const auto take = [](archive*, void* sink, const void* bytes, std::size_t count) {
    static_cast<Sink*>(sink)->Take({static_cast<const std::uint8_t*>(bytes), count});
    return static_cast<la_ssize_t>(count);
  };
  try {
    Check(archive_ != nullptr ? ARCHIVE_OK : ARCHIVE_FATAL);
    // Names are written as they are, in the GNU format. Others convert them by the locale.
    Check(::archive_write_set_format_gnutar(archive_));
    Check(::archive_write_set_bytes_per_block(archive_, static_cast<int>(kTarPiece)));
    Check(::archive_write_set_bytes_in_last_block(archive_, 1));  // no padding
    Check(::archive_write_open(archive_, &sink_, nullptr, take, nullptr));
  } catch (...) {
    ::archive_write_free(archive_);
    throw;
  }
}

TarWriter::~TarWriter() {
  sink_.is_closed = true;
  ::archive_write_free(archive_);
}

void TarWriter::Check(int result) const {
  if (sink_.error) throw IoError(*sink_.error);
  if (result != ARCHIVE_OK)
    throw IoError(say::backup::TarNotWritten(sink_.file.string(), ReasonOf(archive_)));
}

void TarWriter::Begin(const std::string& path, std::int64_t bytes) {
  const std::unique_ptr<archive_entry, FreeEntry> entry(::archive_entry_new());
  ::archive_entry_set_pathname(entry.get(), path.c_str());
  ::archive_entry_set_filetype(entry.get(), AE_IFREG);
  ::archive_entry_set_perm(entry.get(), 0640);
  ::archive_entry_set_mtime(entry.get(), std::time(nullptr), 0);
  ::archive_entry_set_size(entry.get(), bytes);
  Check(::archive_write_header(archive_, entry.get()));
}

void TarWriter::Put(std::span<const std::uint8_t> bytes) {
  const la_ssize_t written = ::archive_write_data(archive_, bytes.data(), bytes.size());
  Check(written == static_cast<la_ssize_t>(bytes.size()) ? ARCHIVE_OK : ARCHIVE_FATAL);
}

TarWriter::Added TarWriter::Add(const fs::path& from, const std::string& path,
                                const std::stop_token& stop) {
  const fs::path source = from / path;
  const Descriptor file(::open(source.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  const auto fail = [&](int error) {
    throw SourceUnreadable(say::backup::NotRead(source.string(), std::strerror(error)));
  };
  struct stat status {};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0) fail(errno);
  if (!S_ISREG(status.st_mode)) fail(EINVAL);
  std::vector<std::uint8_t> piece(kTarPiece);
  Added added{.digest = {.path = path}, .problem = {}};
  Sha256 hash;
  bool has_begun = false;
  for (std::int64_t left = status.st_size; left > 0 || !has_begun;) {
    CheckStop(stop);
    const auto next = std::span(piece).first(
        static_cast<std::size_t>(std::min(left, static_cast<std::int64_t>(piece.size()))));
    ssize_t count = 0;
    if (added.problem.empty() && left > 0) {
      count = ReadAllAt(file.get(), added.digest.bytes, std::as_writable_bytes(next));
      const int error = count < 0 ? errno : EIO;
      if (count < 0 && !has_begun) fail(error);
      if (count < static_cast<ssize_t>(next.size()))
        added.problem = say::backup::FileNotWhole(
            source.string(),
            static_cast<std::int64_t>(added.digest.bytes) + std::max<ssize_t>(count, 0),
            std::strerror(error));
    }
    std::fill(next.begin() + std::max<ssize_t>(count, 0), next.end(), std::uint8_t{0});
    if (!std::exchange(has_begun, true)) Begin(path, status.st_size);
    Put(next);
    hash.Add(next.data(), next.size());
    added.digest.bytes += next.size();
    left -= static_cast<std::int64_t>(next.size());
  }
  added.digest.sha256 = hash.Hex();
  Check(::archive_write_finish_entry(archive_));
  return added;
}

void TarWriter::AddText(const std::string& path, std::string_view text) {
  Begin(path, static_cast<std::int64_t>(text.size()));
  Put({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  Check(::archive_write_finish_entry(archive_));
}

void TarWriter::Close() {
  Check(::archive_write_close(archive_));
  if (sink_.age) sink_.age->Close();
}

TarReader::TarReader(fs::path file)
    : TarReader(Descriptor(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY)),
                file) {}

TarReader::TarReader(Descriptor file, fs::path name)
    : file_(std::move(name)), fd_(std::move(file)) {
  if (fd_.get() < 0) throw DataError(say::backup::NotRead(file_.string(), std::strerror(errno)));
  try {
    ReadNames();
  } catch (const SourceUnreadable& error) {
    throw DataError(say::backup::NoTar(error.message()));
  }
}

void TarReader::ReadNames() {
  struct stat status {};
  if (::fstat(fd_.get(), &status) != 0 || !S_ISREG(status.st_mode))
    throw DataError(say::backup::TarNeither());
  const Reader reader = OpenAt(fd_.get(), 0);
  std::size_t names = 0;
  for (archive_entry* entry = nullptr;;) {
    const int result = ::archive_read_next_header(reader.get(), &entry);
    if (result == ARCHIVE_EOF) break;
    if (result != ARCHIVE_OK) throw SourceUnreadable(ReasonOf(reader.get()));
    const std::string name = NameOf(entry);
    const std::int64_t header = ::archive_read_header_position(reader.get());
    const std::int64_t bytes = ::archive_entry_size(entry);
    if (bytes < 0 || header < 0 || bytes > status.st_size - header)
      throw DataError(say::backup::TarCut(name));
    names += name.size();
    if (entries_.size() >= kMaxFiles || names > kMaxNames)
      throw DataError(say::backup::TarTooMany());
    const Entry place{.header = header, .bytes = static_cast<std::uint64_t>(bytes)};
    if (!entries_.emplace(name, place).second) throw DataError(say::backup::TarTwice(name));
  }
}

void TarReader::Read(const std::string& path, const Take& take) const {
  const auto found = entries_.find(path);
  if (found == entries_.end()) throw SourceUnreadable(say::backup::TarWithout(path));
  const auto fail = [&](Message why) {
    throw SourceUnreadable(say::backup::TarUnreadable(path, std::move(why)));
  };
  const Reader reader = OpenAt(fd_.get(), found->second.header);
  archive_entry* entry = nullptr;
  if (::archive_read_next_header(reader.get(), &entry) != ARCHIVE_OK) fail(ReasonOf(reader.get()));
  const char* name = ::archive_entry_pathname(entry);
  if (name == nullptr || path != name) fail(say::backup::TarChanged());
  std::vector<std::uint8_t> piece(kTarPiece);
  for (std::uint64_t left = found->second.bytes;;) {
    const la_ssize_t count = ::archive_read_data(reader.get(), piece.data(), piece.size());
    if (count < 0) fail(ReasonOf(reader.get()));
    const auto taken = static_cast<std::uint64_t>(count);
    if (taken > left || (taken == 0 && left > 0)) fail(say::backup::TarChanged());
    if (taken == 0) return;
    left -= taken;
    take({piece.data(), static_cast<std::size_t>(count)});
  }
}

std::string TarReader::Text(const std::string& path, std::size_t max_bytes) const {
  const auto found = entries_.find(path);
  if (found != entries_.end() && found->second.bytes > max_bytes)
    throw DataError(say::backup::TarTooLong(path, static_cast<std::int64_t>(max_bytes)));
  std::string text;
  try {
    Read(path,
         [&](std::span<const std::uint8_t> bytes) { text.append(bytes.begin(), bytes.end()); });
  } catch (const SourceUnreadable& error) {
    throw DataError(error.message());
  }
  return text;
}

FileDigest TarReader::Digest(const std::string& path, const std::stop_token& stop) const {
  Sha256 hash;
  FileDigest digest{.path = path};
  Read(path, [&](std::span<const std::uint8_t> bytes) {
    CheckStop(stop);
    hash.Add(bytes.data(), bytes.size());
    digest.bytes += bytes.size();
  });
  digest.sha256 = hash.Hex();
  return digest;
}

FileDigest TarReader::CopyTo(const fs::path& to, const std::string& path,
                             const std::stop_token& stop) const {
  DigestingWriter copy(to, path);
  Read(path, [&](std::span<const std::uint8_t> bytes) {
    CheckStop(stop);
    copy.Write(bytes);
  });
  return copy.Close();
}

}  // namespace plumb
