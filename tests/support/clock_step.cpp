// A library to be loaded before the others: the wall clock goes wrong by as many seconds as the file of PLUMB_CLOCK_OFFSET says.
#include <fcntl.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <cstdlib>

extern "C" __attribute__((visibility("default"))) int clock_gettime(clockid_t clock, timespec* now) noexcept {
  const auto result = static_cast<int>(::syscall(SYS_clock_gettime, clock, now));
  const char* file = std::getenv("PLUMB_CLOCK_OFFSET");
  if (clock != CLOCK_REALTIME || result != 0 || file == nullptr) return result;
  const int fd = ::open(file, O_RDONLY | O_CLOEXEC);
  char text[32] = {};
  if (fd >= 0 && ::read(fd, text, sizeof(text) - 1) > 0) now->tv_sec += std::atol(text);
  if (fd >= 0) ::close(fd);
  return result;
}
