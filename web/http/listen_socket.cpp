// SPDX-License-Identifier: Apache-2.0
#include "web/http/listen_socket.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "algo/base/errors.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr int kBacklog = 128;

sockaddr_storage AddressOf(int socket_fd) {
  sockaddr_storage address{};
  socklen_t length = sizeof address;
  if (getsockname(socket_fd, reinterpret_cast<sockaddr*>(&address), &length) != 0) {
    throw IoError(say::web::CannotListenOnDescriptor(socket_fd, std::strerror(errno)));
  }
  return address;
}

}  // namespace

namespace {

/// An address in numbers with a port, as the system calls take it.
struct Endpoint {
  Endpoint(const std::string& address, std::uint16_t port) {
    v4.sin_family = AF_INET;
    v4.sin_port = htons(port);
    v6.sin6_family = AF_INET6;
    v6.sin6_port = htons(port);
    is_v4 = inet_pton(AF_INET, address.c_str(), &v4.sin_addr) == 1;
    is_valid = is_v4 || inet_pton(AF_INET6, address.c_str(), &v6.sin6_addr) == 1;
  }
  [[nodiscard]] int family() const { return is_v4 ? AF_INET : AF_INET6; }
  [[nodiscard]] int Bind(int fd) const {
    return is_v4 ? bind(fd, reinterpret_cast<const sockaddr*>(&v4), sizeof v4)
                 : bind(fd, reinterpret_cast<const sockaddr*>(&v6), sizeof v6);
  }

  sockaddr_in v4{};
  sockaddr_in6 v6{};
  bool is_v4 = false, is_valid = false;
};

}  // namespace

int OpenListenSocket(const std::string& address, std::uint16_t port) {
  const Endpoint endpoint(address, port);
  if (!endpoint.is_valid) {
    throw IoError(say::web::NotAnAddress(address));
  }
  const int fd = socket(endpoint.family(), SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0 && errno == EAFNOSUPPORT && address == "::")  // a kernel without IPv6
    return OpenListenSocket("0.0.0.0", port);
  const int on = 1, off = 0;
  // For "::": both families, whatever the machine's default is.
  if (endpoint.family() == AF_INET6 && fd >= 0)
    setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof off);
  if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
      setsockopt(fd, IPPROTO_IP, IP_FREEBIND, &on, sizeof on) != 0 || endpoint.Bind(fd) != 0 ||
      listen(fd, kBacklog) != 0) {
    const int error = errno;
    if (fd >= 0) close(fd);
    throw IoError(error == EADDRINUSE
                      ? say::web::PortInUse(address, port, std::strerror(error))
                      : say::web::CannotListen(address, port, std::strerror(error)));
  }
  return fd;
}

std::uint16_t PortOf(int socket_fd) {
  const sockaddr_storage address = AddressOf(socket_fd);
  if (address.ss_family == AF_INET6)
    return ntohs(reinterpret_cast<const sockaddr_in6&>(address).sin6_port);
  return ntohs(reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

std::string AddressTextOf(int socket_fd) {
  const sockaddr_storage address = AddressOf(socket_fd);
  std::array<char, INET6_ADDRSTRLEN> text{};
  const void* bytes =
      address.ss_family == AF_INET6
          ? static_cast<const void*>(&reinterpret_cast<const sockaddr_in6&>(address).sin6_addr)
          : &reinterpret_cast<const sockaddr_in&>(address).sin_addr;
  inet_ntop(address.ss_family, bytes, text.data(), text.size());
  return text.data();
}

bool HasAddress(const std::string& address) {
  const Endpoint endpoint(address, 0);
  const int fd = endpoint.is_valid ? socket(endpoint.family(), SOCK_DGRAM | SOCK_CLOEXEC, 0) : -1;
  if (fd < 0) return false;
  const bool has = endpoint.Bind(fd) == 0;
  close(fd);
  return has;
}

bool IsLoopback(const std::string& address) {
  in_addr v4{};
  in6_addr v6{};
  constexpr std::uint32_t kNet = 127;
  if (inet_pton(AF_INET, address.c_str(), &v4) == 1) return ntohl(v4.s_addr) >> 24 == kNet;
  return inet_pton(AF_INET6, address.c_str(), &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6);
}

bool IsIpv6(int socket_fd) { return AddressOf(socket_fd).ss_family == AF_INET6; }

}  // namespace plumb::web
