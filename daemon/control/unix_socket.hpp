// Addresses of Unix stream sockets, also where the path is longer than an address holds.
#pragma once

#include <filesystem>
#include <functional>

#include <sys/socket.h>
#include <sys/un.h>

namespace plumb {

/// Calls `use` with an address of the path; it holds during the call only. Returns what `use`
/// returns: 0, or -1 with errno. The folder of the path must exist, else -1.
int WithUnixAddress(const std::filesystem::path& path,
                    const std::function<int(const sockaddr*, socklen_t)>& use);

/// A connection to the socket. @throws DeviceError saying that no process listens there, or that
/// access is denied.
[[nodiscard]] int ConnectUnix(const std::filesystem::path& path);

/// A listening socket at the path; one that a dead process left there is replaced. Mode 0660 and
/// group plumb where there is such a group and this process may give it away, else 0600. @throws
/// IoError, also if somebody listens there already.
[[nodiscard]] int ListenUnix(const std::filesystem::path& path);

}  // namespace plumb
