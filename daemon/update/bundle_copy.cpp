// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/bundle_copy.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "daemon/update/bundle_check.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/temporary.hpp"
#include "web/model/kept_free.hpp"
#include "words/update.hpp"

namespace plumb {
namespace {

void CopyAll(int from, const Descriptor& to, std::uint64_t bytes, const std::filesystem::path& path,
             const std::stop_token& stop) {
  std::vector<char> buffer(std::size_t{1} << 20);
  SteadyFlush flush(to, 0);
  for (std::uint64_t at = 0; at < bytes;) {
    CheckStop(stop);
    const ssize_t count = ::pread(from, buffer.data(), buffer.size(), static_cast<off_t>(at));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw IoError(say::update::CopyUnreadable(std::strerror(errno)));
    if (count == 0) throw DataError(say::update::CopyShorter());
    WriteAll(to, {buffer.data(), static_cast<std::size_t>(count)}, path);
    flush.Wrote(static_cast<std::uint64_t>(count));
    at += static_cast<std::uint64_t>(count);
  }
}

}  // namespace

std::uint64_t FreeBytesOf(const std::filesystem::path& folder) {
  struct statvfs disk {};
  if (::statvfs(folder.c_str(), &disk) != 0) throw IoError(DescribeWriteError(folder, errno));
  return static_cast<std::uint64_t>(disk.f_bavail) * disk.f_frsize;
}

void CheckRoom(const std::filesystem::path& folder, std::uint64_t bytes,
               const FreeBytes& free_bytes) {
  const std::uint64_t room = free_bytes(folder);
  if (room < bytes + kKeptFree)
    throw IoError(say::update::DiskFull(WholeMegabytes(bytes), WholeMegabytes(room),
                                        WholeMegabytes(kKeptFree)));
}

void SteadyFlush::Wrote(std::uint64_t bytes) {
  constexpr std::uint64_t kPiece = 8 << 20;
  written_ += bytes;
  if (written_ - started_ < kPiece) return;
  ::sync_file_range(fd_, static_cast<off_t>(started_), static_cast<off_t>(written_ - started_),
                    SYNC_FILE_RANGE_WRITE);
  started_ = written_;
}

std::filesystem::path CopyBundle(int fd, const std::filesystem::path& folder,
                                 std::uint64_t max_bytes, const std::stop_token& stop) {
  struct stat status {};
  if (::fstat(fd, &status) != 0 || !S_ISREG(status.st_mode))
    throw DataError(say::update::CopyNoFile());
  const auto bytes = static_cast<std::uint64_t>(status.st_size);
  if (bytes > max_bytes)
    throw DataError(say::update::CopyTooLarge(WholeMegabytes(bytes), WholeMegabytes(max_bytes)));
  std::error_code ignored;
  std::filesystem::create_directories(folder, ignored);
  CheckRoom(folder, bytes);
  const auto [path, descriptor] = MakeUniqueFile(folder, ".upload-", ".raucb");
  try {
    CopyAll(fd, Descriptor(descriptor), bytes, path, stop);
    SyncToDisk(path);
  } catch (...) {
    ::unlink(path.c_str());
    throw;
  }
  return path;
}

}  // namespace plumb
