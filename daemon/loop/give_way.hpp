// SPDX-License-Identifier: Apache-2.0
// Threads whose work can wait.
#pragma once

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace plumb {

/// From now on the calling thread gets processor and disk time only when they are idle, so that it
/// costs no frames of a scan. If the system refuses, the priority stays unchanged.
inline void GiveWayToScans() {
  constexpr int kLeastPriority = 19, kOfThread = 1, kBestEffort = 2, kLowestOfIts = 7;
  (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kLeastPriority);
  (void)::syscall(SYS_ioprio_set, kOfThread, 0, kBestEffort << 13 | kLowestOfIts);
}

}  // namespace plumb
