// SPDX-License-Identifier: Apache-2.0
// The socket that the server listens on.
#pragma once

#include <cstdint>
#include <string>

namespace plumb::web {

/// A non-blocking listening TCP socket, also at an address that this machine does not have yet: a
/// network may come up later. @throws IoError with address, port and reason.
[[nodiscard]] int OpenListenSocket(const std::string& address, std::uint16_t port);
/// @throws IoError if the descriptor is not a socket.
[[nodiscard]] std::uint16_t PortOf(int socket_fd);
[[nodiscard]] bool IsIpv6(int socket_fd);
/// The listening address in numeric form.
[[nodiscard]] std::string AddressTextOf(int socket_fd);
/// True for a numeric address that this machine has now.
[[nodiscard]] bool HasAddress(const std::string& address);
/// True for an address that can be reached from this machine only: 127.0.0.0/8, ::1.
[[nodiscard]] bool IsLoopback(const std::string& address);

}  // namespace plumb::web
