// A bundle that somebody handed over as an open file.
#pragma once

#include <cstdint>
#include <filesystem>

namespace plumb {

/// Copies a regular file into the folder, under a name that the next start removes if nobody takes
/// it. What is left of a failed copy is removed.
/// @throws DataError for no regular file and for a too large one, IoError where it cannot be
/// written or the disk would be too full for scans then.
[[nodiscard]] std::filesystem::path CopyBundle(int fd, const std::filesystem::path& folder,
                                               std::uint64_t max_bytes);

}  // namespace plumb
