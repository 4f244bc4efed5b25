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

}  // namespace plumb::web
