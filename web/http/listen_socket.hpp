// The socket that the server listens on.
#pragma once

#include <cstdint>
#include <string>

namespace plumb::web {

/// A listening TCP socket, not blocking. @throws IoError with address, port and reason.
[[nodiscard]] int OpenListenSocket(const std::string& address, std::uint16_t port);
/// @throws IoError if the descriptor is no socket.
[[nodiscard]] std::uint16_t PortOf(int socket_fd);
[[nodiscard]] bool IsIpv6(int socket_fd);
/// The address that it listens on, in numbers.
[[nodiscard]] std::string AddressTextOf(int socket_fd);
/// True for an address that only this machine reaches: 127.0.0.0/8, ::1.
[[nodiscard]] bool IsLoopback(const std::string& address);

}  // namespace plumb::web
