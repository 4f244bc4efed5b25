// SPDX-License-Identifier: Apache-2.0
// A library to be loaded before the others: the n-th open, write, sync, rename or mkdir below a
// folder fails. See failing_calls.hpp.
#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>

namespace {

enum Call { kOpen, kWrite, kSync, kRename, kMkdir };

std::atomic<int> armed{-1};  // the kind that fails; -1: none
std::atomic<long> wanted{0}, seen{0}, failed{0};
std::atomic<int> error_number{0}, for_good{0};
char folder[PATH_MAX];

template <typename Function>
Function* Next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

bool IsBelow(const char* path) { return std::strncmp(path, folder, std::strlen(folder)) == 0; }

bool IsBelow(int fd) {
  char link[64], path[PATH_MAX] = {};
  std::snprintf(link, sizeof(link), "/proc/self/fd/%d", fd);
  return ::readlink(link, path, sizeof(path) - 1) > 0 && IsBelow(path);
}

template <typename Where>
bool Fails(Call call, Where where) {
  if (armed != call || !IsBelow(where)) return false;
  const long number = ++seen;
  if (number < wanted) return false;
  // A write that is cut short is followed by one that fails: two in all.
  const long last = error_number == 0 ? wanted + 1 : wanted.load();
  if (for_good == 0 && number > last) return false;
  ++failed;
  return true;
}

ssize_t FailWrite(ssize_t (*write)(int, const void*, size_t), int fd, const void* bytes,
                  size_t count) {
  if (error_number != 0) {
    errno = error_number;
    return -1;
  }
  if (seen == wanted && count > 1) return write(fd, bytes, count / 2);
  errno = ENOSPC;
  return -1;
}

int FailWith() {
  errno = error_number == 0 ? EIO : error_number.load();
  return -1;
}

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

void plumb_arm_fault(int call, long nth, int error, int lasting, const char* below) {
  std::snprintf(folder, sizeof(folder), "%s", below);
  wanted = nth;
  seen = failed = 0;
  error_number = error;
  for_good = lasting;
  armed = nth > 0 ? call : -1;
}

long plumb_disarm_fault() {
  armed = -1;
  return failed;
}

int open(const char* path, int flags, ...) {
  static auto* const kNext = Next<int(const char*, int, ...)>("open");
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return Fails(kOpen, path) ? FailWith() : kNext(path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  static auto* const kNext = Next<int(const char*, int, ...)>("open64");
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return Fails(kOpen, path) ? FailWith() : kNext(path, flags, mode);
}

ssize_t write(int fd, const void* bytes, size_t count) {
  static auto* const kNext = Next<ssize_t(int, const void*, size_t)>("write");
  return Fails(kWrite, fd) ? FailWrite(kNext, fd, bytes, count) : kNext(fd, bytes, count);
}

ssize_t pwrite64(int fd, const void* bytes, size_t count, off64_t offset) {
  static auto* const kNext = Next<ssize_t(int, const void*, size_t, off64_t)>("pwrite64");
  if (!Fails(kWrite, fd)) return kNext(fd, bytes, count, offset);
  if (error_number == 0 && seen == wanted && count > 1) return kNext(fd, bytes, count / 2, offset);
  errno = error_number == 0 ? ENOSPC : error_number.load();
  return -1;
}

int fsync(int fd) {
  static auto* const kNext = Next<int(int)>("fsync");
  return Fails(kSync, fd) ? FailWith() : kNext(fd);
}

int fdatasync(int fd) {
  static auto* const kNext = Next<int(int)>("fdatasync");
  return Fails(kSync, fd) ? FailWith() : kNext(fd);
}

int syncfs(int fd) noexcept {
  static auto* const kNext = Next<int(int)>("syncfs");
  return Fails(kSync, fd) ? FailWith() : kNext(fd);
}

int rename(const char* from, const char* to) noexcept {
  static auto* const kNext = Next<int(const char*, const char*)>("rename");
  return Fails(kRename, from) ? FailWith() : kNext(from, to);
}

int mkdir(const char* path, mode_t mode) noexcept {
  static auto* const kNext = Next<int(const char*, mode_t)>("mkdir");
  return Fails(kMkdir, path) ? FailWith() : kNext(path, mode);
}

}  // extern "C"
#pragma GCC visibility pop
