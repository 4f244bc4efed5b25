// SPDX-License-Identifier: Apache-2.0
// A library to be loaded before the others: what goes to the journal's socket goes to the one that
// PLUMB_JOURNAL names instead.
#include <dlfcn.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cstdlib>
#include <cstring>

extern "C" __attribute__((visibility("default"))) ssize_t sendto(int socket, const void* data,
                                                                 size_t size, int flags,
                                                                 const sockaddr* to,
                                                                 socklen_t to_size) {
  static const auto kSendTo = reinterpret_cast<decltype(&sendto)>(::dlsym(RTLD_NEXT, "sendto"));
  const char* const elsewhere = std::getenv("PLUMB_JOURNAL");
  sockaddr_un other{};
  if (elsewhere == nullptr || to == nullptr || to->sa_family != AF_UNIX ||
      std::strcmp(reinterpret_cast<const sockaddr_un*>(to)->sun_path,
                  "/run/systemd/journal/socket") != 0)
    return kSendTo(socket, data, size, flags, to, to_size);
  other.sun_family = AF_UNIX;
  std::strncpy(other.sun_path, elsewhere, sizeof other.sun_path - 1);
  return kSendTo(socket, data, size, flags, reinterpret_cast<const sockaddr*>(&other),
                 sizeof other);
}
