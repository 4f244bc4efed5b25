// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/file_io.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "algo/base/errors.hpp"
#include "words/file.hpp"

namespace plumb {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 18;

void SyncBy(int (*sync)(int), const std::filesystem::path& path) {
  const Descriptor opened(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (opened.get() < 0) throw IoError(DescribeWriteError(path, errno));
  if (sync(opened.get()) != 0 && errno != EINVAL)  // EINVAL: a file system without fsync
    throw IoError(DescribeWriteError(path, errno));
}

std::string ErrorText(int error_number) { return std::generic_category().message(error_number); }

/// Reads a regular file into any contiguous container of bytes.
template <typename Container>
Container ReadInto(const std::filesystem::path& path, std::size_t max_bytes) {
  // O_NONBLOCK: opening a FIFO must not wait for a writer; regular files ignore it.
  const Descriptor file = OpenForReading(path);
  if (file.get() < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) throw DataError(say::file::Missing(path.string()));
    // not an error of the file, so the message must not ask to correct it
    if (error == EMFILE || error == ENFILE)
      throw IoError(say::file::TooManyOpen(path.string(), ErrorText(error)));
    throw DataError(say::file::CannotOpen(path.string(), ErrorText(error)));
  }
  struct stat status {};
  if (::fstat(file.get(), &status) != 0)
    throw DataError(say::file::CannotStat(path.string(), ErrorText(errno)));
  if (!S_ISREG(status.st_mode)) throw DataError(say::file::NotRegular(path.string()));
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size > max_bytes) {
    throw DataError(say::file::TooLarge(path.string(), size, max_bytes));
  }
  Container bytes(size, {});
  std::size_t done = 0;
  while (done < size) {
    const ssize_t got = ::read(file.get(), bytes.data() + done, size - done);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw DataError(say::file::CannotRead(path.string(), ErrorText(errno)));
    if (got == 0) break;  // the file shrank meanwhile: its reader will find it truncated
    done += static_cast<std::size_t>(got);
  }
  bytes.resize(done);
  return bytes;
}

std::span<const std::uint8_t> AsBytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

std::vector<std::uint8_t> ReadWholeFile(const std::filesystem::path& path, std::size_t max_bytes) {
  return ReadInto<std::vector<std::uint8_t>>(path, max_bytes);
}

std::string ReadTextFile(const std::filesystem::path& path, std::size_t max_bytes) {
  return ReadInto<std::string>(path, max_bytes);
}

Message DescribeWriteError(const std::filesystem::path& path, int error_number) {
  const std::string file = path.string(), why = ErrorText(error_number);
  switch (error_number) {
    case ENOSPC:
    case EDQUOT:
      return say::file::DiskFull(file, why);
    case EFBIG:
      return say::file::SizeLimit(file, why);
    case EACCES:
    case EPERM:
    case EROFS:
      return say::file::NotPermitted(file, why);
    case ENOENT:
      return say::file::NoFolder(file, why);
    default:
      return say::file::CannotWrite(file, why);
  }
}

FileWriter::FileWriter(std::filesystem::path path) : path_(std::move(path)) {
  descriptor_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor_ < 0) throw IoError(DescribeWriteError(path_, errno));
  struct stat status {};
  regular_ = ::fstat(descriptor_, &status) == 0 && S_ISREG(status.st_mode);
  buffer_.reserve(kBufferBytes);
}

FileWriter::~FileWriter() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  Discard();
}

void FileWriter::Discard() {
  if (regular_) ::unlink(path_.c_str());
}

void FileWriter::Write(std::span<const std::uint8_t> bytes) {
  if (buffer_.size() + bytes.size() > kBufferBytes) Flush();
  if (bytes.size() > kBufferBytes) {
    WriteThrough(bytes);
  } else {
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  }
}

void FileWriter::Write(std::string_view text) { Write(AsBytes(text)); }

void FileWriter::Flush() {
  WriteThrough(buffer_);
  buffer_.clear();
}

void FileWriter::WriteThrough(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw IoError(DescribeWriteError(path_, errno));
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

void FileWriter::Close() {
  Flush();
  const int descriptor = std::exchange(descriptor_, -1);
  if (::close(descriptor) != 0) {
    const int error = errno;
    Discard();
    throw IoError(DescribeWriteError(path_, error));
  }
}

void WriteWholeFile(const std::filesystem::path& path, std::span<const std::uint8_t> bytes) {
  FileWriter file(path);
  file.Write(bytes);
  file.Close();
}

void WriteWholeFile(const std::filesystem::path& path, std::string_view text) {
  WriteWholeFile(path, AsBytes(text));
}

void SyncToDisk(const std::filesystem::path& path) { SyncBy(::fsync, path); }

void SyncWholeDisk(const std::filesystem::path& path) { SyncBy(::syncfs, path); }

void WriteAll(const Descriptor& file, std::string_view bytes, const std::filesystem::path& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file.get(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw IoError(DescribeWriteError(path, written < 0 ? errno : EIO));
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

}  // namespace plumb
