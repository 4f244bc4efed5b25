// SPDX-License-Identifier: Apache-2.0
// Unix stream sockets, including paths that are too long for a socket address.
#pragma once

#include <filesystem>
#include <functional>

#include <sys/socket.h>
#include <sys/un.h>

namespace plumb {

/// Calls `use` with an address for the path, which is valid during the call only. Returns the
/// result of `use`: 0, or -1 with errno. The folder of the path must exist, otherwise -1.
int WithUnixAddress(const std::filesystem::path& path,
                    const std::function<int(const sockaddr*, socklen_t)>& use);

/// Connects to the socket.
/// @throws DeviceError stating that no process listens there, or that access is denied.
[[nodiscard]] int ConnectUnix(const std::filesystem::path& path);

/// A listening socket at the path; one left by a dead process is replaced. Mode 0660 and group
/// plumb if that group exists and this process may assign it, otherwise 0600.
/// @throws IoError, also if another process listens there already.
[[nodiscard]] int ListenUnix(const std::filesystem::path& path);

}  // namespace plumb
