// SPDX-License-Identifier: Apache-2.0
// A disk that fills up, for tests of what is left behind.
#pragma once

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <exception>

#include "algo/base/errors.hpp"

namespace plumb::testing {

/// How a write ended that ran against a full disk.
enum class WriteOutcome : int { kDone = 0, kIoError = 1, kOtherError = 2, kDied = 3 };

/// Runs `write` in a child process in which no file can grow beyond `max_bytes`: as on a full disk,
/// the kernel cuts one write short and refuses the next (with EFBIG in place of ENOSPC).
template <typename Write>
WriteOutcome WriteOnFullDisk(unsigned long max_bytes, const Write& write) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{max_bytes, max_bytes};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    WriteOutcome outcome = WriteOutcome::kDone;
    try {
      write();
    } catch (const IoError&) {
      outcome = WriteOutcome::kIoError;
    } catch (const std::exception&) {
      outcome = WriteOutcome::kOtherError;
    }
    ::_exit(static_cast<int>(outcome));
  }
  int status = 0;
  if (child < 0 || ::waitpid(child, &status, 0) != child || !WIFEXITED(status))
    return WriteOutcome::kDied;
  return static_cast<WriteOutcome>(WEXITSTATUS(status));
}

}  // namespace plumb::testing
