// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/unix_socket.hpp"

#include <fcntl.h>
#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "words/control.hpp"

namespace plumb {

int WithUnixAddress(const std::filesystem::path& path,
                    const std::function<int(const sockaddr*, socklen_t)>& use) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::string text = path.string();
  int folder = -1;
  if (text.size() >=
      sizeof(address.sun_path)) {  // paths above 107 characters are opened through their folder
    const std::filesystem::path parent = path.has_parent_path() ? path.parent_path() : ".";
    folder = ::open(parent.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) return -1;
    text = fmt::format("/proc/self/fd/{}/{}", folder, path.filename().string());
  }
  int result = -1;
  if (text.size() < sizeof(address.sun_path)) {
    std::memcpy(address.sun_path, text.c_str(), text.size() + 1);
    result = use(reinterpret_cast<const sockaddr*>(&address), sizeof(address));
  } else {
    errno = ENAMETOOLONG;
  }
  const int error = errno;
  if (folder >= 0) ::close(folder);
  errno = error;
  return result;
}

int ConnectUnix(const std::filesystem::path& path) {
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) throw DeviceError(say::control::NoSocket(std::strerror(errno)));
  if (WithUnixAddress(path, [&](const sockaddr* address, socklen_t size) {
        return ::connect(fd, address, size);
      }) == 0)
    return fd;
  const int error = errno;
  ::close(fd);
  throw DeviceError(error == EACCES
                        ? say::control::NoAccess(path.string(), std::strerror(error))
                        : say::control::CannotReach(path.string(), std::strerror(error)));
}

namespace {

/// Removes a socket on which no process listens any more.
void RemoveDeadSocket(const std::filesystem::path& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return;
  if (!S_ISSOCK(status.st_mode)) throw IoError(say::control::NameTaken(path.string()));
  try {
    ::close(ConnectUnix(path));
  } catch (const DeviceError&) {
    ::unlink(path.c_str());
    return;
  }
  throw IoError(say::control::AnotherPlumbd(path.string()));
}

void OpenToGroup(const std::filesystem::path& path) {
  ::chmod(path.c_str(), 0600);
  const group* plumb = ::getgrnam("plumb");
  if (plumb != nullptr && ::lchown(path.c_str(), static_cast<uid_t>(-1), plumb->gr_gid) == 0)
    ::chmod(path.c_str(), 0660);
}

}  // namespace

int ListenUnix(const std::filesystem::path& path) {
  RemoveDeadSocket(path);
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) throw IoError(say::control::NoSocket(std::strerror(errno)));
  const mode_t before = ::umask(0177);  // no other user may connect before the mode is set
  const int bound = WithUnixAddress(
      path, [&](const sockaddr* address, socklen_t size) { return ::bind(fd, address, size); });
  const int error = errno;
  ::umask(before);
  if (bound != 0 || ::listen(fd, 16) != 0) {
    ::close(fd);
    throw IoError(say::control::CannotListen(path.string(), std::strerror(error)));
  }
  OpenToGroup(path);
  return fd;
}

}  // namespace plumb
