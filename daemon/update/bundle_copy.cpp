#include "daemon/update/bundle_copy.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/temporary.hpp"

namespace plumb {
namespace {

constexpr std::uint64_t kLeftFree = std::uint64_t{256} << 20;  ///< For scans meanwhile.

void CheckRoom(const std::filesystem::path& folder, std::uint64_t bytes) {
  struct statvfs disk {};
  if (::statvfs(folder.c_str(), &disk) != 0) throw IoError(DescribeWriteError(folder, errno));
  const std::uint64_t room = static_cast<std::uint64_t>(disk.f_bavail) * disk.f_frsize;
  if (room < bytes + kLeftFree)
    throw IoError(fmt::format("the disk is too full for a bundle of {} MB: {} MB are free",
                              bytes >> 20, room >> 20));
}

void CopyAll(int from, const Descriptor& to, std::uint64_t bytes,
             const std::filesystem::path& path) {
  std::vector<char> buffer(std::size_t{1} << 20);
  for (std::uint64_t at = 0; at < bytes;) {
    const ssize_t count = ::pread(from, buffer.data(), buffer.size(), static_cast<off_t>(at));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0)
      throw IoError(fmt::format("the bundle cannot be read: {}", std::strerror(errno)));
    if (count == 0) throw DataError("the bundle became shorter while it was read; send it again");
    WriteAll(to, {buffer.data(), static_cast<std::size_t>(count)}, path);
    at += static_cast<std::uint64_t>(count);
  }
}

}  // namespace

std::filesystem::path CopyBundle(int fd, const std::filesystem::path& folder,
                                 std::uint64_t max_bytes) {
  struct stat status {};
  if (::fstat(fd, &status) != 0 || !S_ISREG(status.st_mode))
    throw DataError("the bundle is not a regular file");
  const auto bytes = static_cast<std::uint64_t>(status.st_size);
  if (bytes > max_bytes)
    throw DataError(
        fmt::format("the bundle is too large: {} MB, at most {} MB", bytes >> 20, max_bytes >> 20));
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
