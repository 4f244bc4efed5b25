// Whether a backup would last at the place that somebody names.
#pragma once

#include <filesystem>
#include <string>

namespace plumb {

/// Why a backup that plumbd makes at `target` would be lost; empty if no reason is known. With
/// PrivateTmp=, systemd gives a service a /tmp that other processes cannot see and that is deleted
/// when the service stops; a file system in memory is empty after a reboot. Memory is accepted if
/// the state folder is in memory, too.
/// @param mounts  The text of /proc/self/mountinfo.
[[nodiscard]] std::string WhyBackupIsLostAt(const std::filesystem::path& target,
                                            const std::filesystem::path& state,
                                            const std::string& mounts);

/// With the mounts of this process. @throws std::invalid_argument with the reason
void RequireLastingPlace(const std::filesystem::path& target, const std::filesystem::path& state);

}  // namespace plumb
