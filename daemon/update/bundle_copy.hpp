// SPDX-License-Identifier: Apache-2.0
// Copies a bundle that was passed as an open file.
#pragma once

#include <cstdint>
#include <filesystem>

namespace plumb {

/// Copies a regular file into the folder, under a name that the next start removes if it is not
/// used. Remains of a failed copy are removed.
/// @throws DataError if it is not a regular file or is too large, IoError if it cannot be written
///         or would leave too little space for scans.
[[nodiscard]] std::filesystem::path CopyBundle(int fd, const std::filesystem::path& folder,
                                               std::uint64_t max_bytes);

}  // namespace plumb
