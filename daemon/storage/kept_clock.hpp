// SPDX-License-Identifier: Apache-2.0
// Whether something keeps the wall clock right.
#pragma once

#include <sys/timex.h>

#include <chrono>
#include <filesystem>
#include <functional>

namespace plumb {

/// Whether systemd-timedated says so. Waits for the system bus.
[[nodiscard]] bool IsKeptByTimedated(std::chrono::milliseconds patience);

/// Who is asked.
struct AskClock {
  /// As adjtimex(2): at least 0, or -1 where it refuses. In plumbd's sandbox (ProtectClock=) no
  /// process may ask the kernel.
  std::function<int(timex& state)> kernel = [](timex& state) { return ::adjtimex(&state); };
  /// Instead of a kernel that refuses.
  std::function<bool()> timedated = [] { return IsKeptByTimedated(std::chrono::seconds(5)); };
};

/// Whether a time server has set the clock since the machine started. systemd-timesyncd leaves a
/// note; other programs (chrony, ntpd, ptp4l) tell the kernel. The call can block for up to five
/// seconds.
/// @param note  The file that systemd-timesyncd writes when a server answers for the first time.
[[nodiscard]] bool IsClockKept(
    const std::filesystem::path& note = "/run/systemd/timesync/synchronized",
    const AskClock& ask = {});

}  // namespace plumb
