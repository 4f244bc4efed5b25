// SPDX-License-Identifier: Apache-2.0
// The parent's side of reader programs (reader_program.hpp).
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "algo/base/message.hpp"

namespace plumb {

/// How long a reader program may be silent.
inline constexpr std::chrono::seconds kReaderPatience{30};

/// A running reader program and our end of its pipe. The destructor ends the program. Not
/// thread-safe.
class ReaderProcess {
 public:
  /// @throws IoError if the program cannot be started.
  ReaderProcess(const std::filesystem::path& program, std::vector<std::string> arguments);
  ~ReaderProcess();
  ReaderProcess(const ReaderProcess&) = delete;
  ReaderProcess& operator=(const ReaderProcess&) = delete;

  enum class Got { kAll, kEnd, kSilence };
  /// Reads exactly so many bytes; gives up when none have come for kReaderPatience.
  [[nodiscard]] Got Read(void* data, std::size_t size);

  /// How the program ended, once its pipe is closed.
  struct End {
    bool crashed = false;
    int code = 0;  ///< Its exit code, or the signal that it crashed with.
  };
  [[nodiscard]] End Reap();

 private:
  pid_t pid_ = -1;
  int descriptor_ = -1;
};

/// The error that ReaderErrorText() wrote. Accepts any text.
[[nodiscard]] Message ReaderErrorOf(std::string_view text);

}  // namespace plumb
