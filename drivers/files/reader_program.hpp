// SPDX-License-Identifier: Apache-2.0
// The child's side of reader programs: separate processes that open files whose libraries or
// formats are dangerous, and write the contents to a pipe to their parent.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <string>

namespace plumb {

/// What a reader program may use.
struct ReaderLimits {
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;
  std::uint64_t cpu_s = 0;  ///< 0: no limit.
};

/// Runs the program with no more rights than its parent, with little memory and without core dumps.
/// It ends as soon as the parent closes the pipe, even if the reading hangs, otherwise with the
/// code that `read` returns; no destructors run.
[[noreturn]] void RunReaderProgram(const std::function<int()>& read,
                                   const ReaderLimits& limits = {});

/// @throws IoError if the parent is gone.
void WriteToParent(const void* data, std::size_t size);
template <typename Value>
void WriteToParent(const Value& value) {
  WriteToParent(&value, sizeof value);
}

/// Longest text of an error.
inline constexpr std::size_t kMaxReaderError = 4096;
/// An error as JSON for the parent, with its identity unless it would be too long;
/// ReaderErrorOf() reads it.
[[nodiscard]] std::string ReaderErrorText(const std::exception& error);

}  // namespace plumb
