// Whether a backup would last at the place that somebody names.
#pragma once

#include <filesystem>
#include <string>

namespace plumb {

/// Why a backup of a running plumbd at `target` would be lost; empty if nothing is known against
/// it. Systemd gives a service a /tmp of its own, which nobody else sees and which ends with it,
/// and what lies in memory is gone after a restart of the machine. Memory is accepted if the state
/// folder lies there as well.
/// @param mounts  The text of /proc/self/mountinfo.
[[nodiscard]] std::string WhyBackupIsLostAt(const std::filesystem::path& target,
                                            const std::filesystem::path& state,
                                            const std::string& mounts);

/// With the mounts of this process. @throws std::invalid_argument with the reason
void RequireLastingPlace(const std::filesystem::path& target, const std::filesystem::path& state);

}  // namespace plumb
