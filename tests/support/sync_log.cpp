// SPDX-License-Identifier: Apache-2.0
// A library to be loaded before the others: writes to the file of PLUMB_SYNC_LOG, in their order,
// what was put onto the disk and what was renamed: `fsync INODE SIZE`, `fdatasync FILE`, `syncfs`,
// `rename FROM TO`.
#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>

namespace {

template <typename Function>
Function* Next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

void Note(const std::string& line) {
  const char* file = std::getenv("PLUMB_SYNC_LOG");
  const int fd =
      file != nullptr ? ::open(file, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600) : -1;
  if (fd < 0) return;
  (void)!::write(fd, line.data(), line.size());
  ::close(fd);
}

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

int fsync(int fd) {
  static auto* const kNext = Next<int(int)>("fsync");
  struct stat status {};
  ::fstat(fd, &status);
  const int result = kNext(fd);
  if (result == 0)
    Note("fsync " + std::to_string(status.st_ino) + " " + std::to_string(status.st_size) + "\n");
  return result;
}

int fdatasync(int fd) {
  static auto* const kNext = Next<int(int)>("fdatasync");
  char path[PATH_MAX] = {};
  (void)!::readlink(("/proc/self/fd/" + std::to_string(fd)).c_str(), path, sizeof(path) - 1);
  const int result = kNext(fd);
  if (result == 0) Note("fdatasync " + std::string(path) + "\n");
  return result;
}

int syncfs(int fd) noexcept {
  static auto* const kNext = Next<int(int)>("syncfs");
  const int result = kNext(fd);
  if (result == 0) Note("syncfs\n");
  return result;
}

int rename(const char* from, const char* to) noexcept {
  static auto* const kNext = Next<int(const char*, const char*)>("rename");
  const int result = kNext(from, to);
  if (result == 0) Note("rename " + std::string(from) + " " + to + "\n");
  return result;
}

}  // extern "C"
#pragma GCC visibility pop
