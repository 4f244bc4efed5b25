// SPDX-License-Identifier: Apache-2.0
// A library to be loaded before the others: the wall clock goes wrong by as many seconds as the
// file of PLUMB_CLOCK_OFFSET says.
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <cstdlib>

namespace {

time_t OffsetSeconds() {
  const char* file = std::getenv("PLUMB_CLOCK_OFFSET");
  if (file == nullptr) return 0;
  const int fd = ::open(file, O_RDONLY | O_CLOEXEC);
  char text[32] = {};
  const bool is_read = fd >= 0 && ::read(fd, text, sizeof(text) - 1) > 0;
  if (fd >= 0) ::close(fd);
  return is_read ? std::atol(text) : 0;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) int clock_gettime(clockid_t clock,
                                                                    timespec* now) noexcept {
  const auto result = static_cast<int>(::syscall(SYS_clock_gettime, clock, now));
  if (clock == CLOCK_REALTIME && result == 0) now->tv_sec += OffsetSeconds();
  return result;
}

// OpenNI2 waits for the end of its threads until a time of the wall clock and then cancels them. A
// clock that really steps is also the kernel's clock; this one is not, so the time is converted
// to the kernel's clock.
extern "C" __attribute__((visibility("default"))) int pthread_timedjoin_np(
    pthread_t thread, void** result, const timespec* deadline) {
  static const auto kJoin =
      reinterpret_cast<decltype(&pthread_timedjoin_np)>(::dlsym(RTLD_NEXT, "pthread_timedjoin_np"));
  timespec kernels = *deadline;
  kernels.tv_sec -= OffsetSeconds();
  return kJoin(thread, result, &kernels);
}
