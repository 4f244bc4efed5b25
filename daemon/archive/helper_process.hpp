// SPDX-License-Identifier: Apache-2.0
// Programs that are run as helpers, without a shell, environment or terminal. They get open files
// and are killed with the thread that started them.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/files/descriptor.hpp"

namespace plumb {

/// @throws IoError if there is none
[[nodiscard]] std::filesystem::path ProgramInPath(const char* name);

/// A file in memory that can hold so many bytes and no more. @throws IoError
[[nodiscard]] Descriptor MemoryFile(std::size_t bytes);
/// What was written into it.
[[nodiscard]] std::string TextInMemory(const Descriptor& memory, std::size_t most);

struct Channel {
  Descriptor ours, its;
};
/// A socket, because a write to it need not raise SIGPIPE. @throws IoError
[[nodiscard]] Channel MakeChannel(const std::string& program);

/// A child that is killed and reaped if it has not ended by itself.
class HelperProcess {
 public:
  /// @throws IoError if it cannot be run
  HelperProcess(const std::filesystem::path& program, std::vector<std::string> arguments, int input,
                int output);
  ~HelperProcess();
  HelperProcess(const HelperProcess&) = delete;
  HelperProcess& operator=(const HelperProcess&) = delete;

  /// Waits for its end. @return its error in one line; empty if it had none.
  std::string Wait();
  /// Once it has ended; -1: a signal ended it.
  [[nodiscard]] int exit_code() const { return exit_code_; }

 private:
  Descriptor said_;
  pid_t pid_ = -1;
  int exit_code_ = -1;
};

}  // namespace plumb
