// SPDX-License-Identifier: Apache-2.0
// Bundles on their way into the folder: room for them, and copies of files that are open. All of it
// may take minutes: not for the loop.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>

#include "drivers/files/descriptor.hpp"

namespace plumb {

/// Free bytes on the disk of a folder.
using FreeBytes = std::function<std::uint64_t(const std::filesystem::path& folder)>;
/// @throws IoError if the disk cannot be asked.
[[nodiscard]] std::uint64_t FreeBytesOf(const std::filesystem::path& folder);

/// The one rule for what plumbd fetches and copies; uploads have the same reserve, kKeptFree.
/// @throws IoError if so many more bytes would leave too little for scans.
void CheckRoom(const std::filesystem::path& folder, std::uint64_t bytes,
               const FreeBytes& free_bytes = FreeBytesOf);

/// Puts on the disk what a file grows by, piece by piece, so that its fsync has little left to do.
class SteadyFlush {
 public:
  /// @param from  Length of the file.
  SteadyFlush(const Descriptor& file, std::uint64_t from)
      : fd_(file.get()), started_(from), written_(from) {}
  void Wrote(std::uint64_t bytes);

 private:
  int fd_;
  std::uint64_t started_, written_;
};

/// Copies a regular file into the folder, durably, under a name that the next start removes if it
/// is not used. Remains of a failed copy are removed.
/// @throws DataError if it is not a regular file or is too large, IoError if it cannot be written
///         or would leave too little space for scans; Interrupted.
[[nodiscard]] std::filesystem::path CopyBundle(int fd, const std::filesystem::path& folder,
                                               std::uint64_t max_bytes,
                                               const std::stop_token& stop = {});

}  // namespace plumb
