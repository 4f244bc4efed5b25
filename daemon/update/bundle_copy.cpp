// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/bundle_copy.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "algo/base/errors.hpp"
#include "daemon/update/bundle_check.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/temporary.hpp"
#include "words/update.hpp"

namespace plumb {
namespace {

constexpr std::uint64_t kLeftFree = std::uint64_t{256} << 20;  ///< For scans meanwhile.

void CheckRoom(const std::filesystem::path& folder, std::uint64_t bytes) {
  struct statvfs disk {};
  if (::statvfs(folder.c_str(), &disk) != 0) throw IoError(DescribeWriteError(folder, errno));
  const std::uint64_t room = static_cast<std::uint64_t>(disk.f_bavail) * disk.f_frsize;
  if (room < bytes + kLeftFree)
    throw IoError(say::update::DiskFull(WholeMegabytes(bytes), WholeMegabytes(room)));
}

void CopyAll(int from, const Descriptor& to, std::uint64_t bytes,
             const std::filesystem::path& path) {
  std::vector<char> buffer(std::size_t{1} << 20);
  for (std::uint64_t at = 0; at < bytes;) {
    const ssize_t count = ::pread(from, buffer.data(), buffer.size(), static_cast<off_t>(at));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw IoError(say::update::CopyUnreadable(std::strerror(errno)));
    if (count == 0) throw DataError(say::update::CopyShorter());
    WriteAll(to, {buffer.data(), static_cast<std::size_t>(count)}, path);
    at += static_cast<std::uint64_t>(count);
  }
}

}  // namespace

std::filesystem::path CopyBundle(int fd, const std::filesystem::path& folder,
                                 std::uint64_t max_bytes) {
  struct stat status {};
  if (::fstat(fd, &status) != 0 || !S_ISREG(status.st_mode))
    throw DataError(say::update::CopyNoFile());
  const auto bytes = static_cast<std::uint64_t>(status.st_size);
  if (bytes > max_bytes)
    throw DataError(say::update::CopyTooLarge(WholeMegabytes(bytes), WholeMegabytes(max_bytes)));
  std::error_code ignored;
  std::filesystem::create_directories(folder, ignored);
  CheckRoom(folder, bytes);
  const auto [path, descriptor] = MakeUniqueFile(folder, ".upload-");
  try {
    CopyAll(fd, Descriptor(descriptor), bytes, path);
  } catch (...) {
    ::unlink(path.c_str());
    throw;
  }
  return path;
}

}  // namespace plumb
