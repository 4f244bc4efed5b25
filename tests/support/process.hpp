// SPDX-License-Identifier: Apache-2.0
// Runs a program as a user does: its exit code, what it prints, signals on the way.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

namespace plumb {

struct ProcessOptions {
  int num_cpus = 0;  ///< > 0: only so many processors may be used.
  long max_file_bytes =
      0;  ///< > 0: writes beyond fail with EFBIG, as a full disk does with ENOSPC.
  std::string stdout_path = {};  ///< Not empty: stdout goes there instead of being captured.
};

/// A running program. The destructor kills it if it still runs.
class Process {
 public:
  Process(const std::vector<std::string>& arguments, const ProcessOptions& options = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// Reads stderr until it holds the text; false if the program ended before.
  bool WaitForStderr(std::string_view text);
  bool WaitForStdout(std::string_view text);
  void Signal(int signal) const;

  /// Reads all output until the end. Exit code, or -signal if one killed it.
  int Wait();

  [[nodiscard]] const std::string& out() const { return out_; }
  [[nodiscard]] const std::string& err() const { return err_; }

 private:
  bool ReadSome();  ///< Blocks for output; false once both ends are closed.

  pid_t pid_ = -1;
  int out_fd_ = -1, err_fd_ = -1;
  std::string out_, err_;
};

struct RunResult {
  int exit_code = 0;
  std::string out, err;
};

/// Runs a program to its end.
[[nodiscard]] RunResult Run(const std::vector<std::string>& arguments,
                            const ProcessOptions& options = {});

}  // namespace plumb
