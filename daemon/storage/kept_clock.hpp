// SPDX-License-Identifier: Apache-2.0
// Whether something keeps the wall clock right.
#pragma once

#include <filesystem>
#include <functional>

struct timex;

namespace plumb {

/// Asks as adjtimex(2) does: at least 0, or -1 where it refuses.
using AskKernelClock = std::function<int(timex& state)>;

/// Whether a time server has set the clock since the machine started. systemd-timesyncd leaves a
/// note; other programs (chrony, ntpd, ptp4l) tell the kernel. May take seconds.
/// @param note  The file that systemd-timesyncd writes when a server answers for the first time.
[[nodiscard]] bool IsClockKept(
    const std::filesystem::path& note = "/run/systemd/timesync/synchronized",
    const AskKernelClock& ask = {});

}  // namespace plumb
