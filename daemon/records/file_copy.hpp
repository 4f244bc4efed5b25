// Copies of files for backups, with their digests.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>

#include "algo/base/errors.hpp"
#include "daemon/records/scan_files.hpp"

namespace plumb {

/// The original cannot be read; the copy is not at fault.
class SourceUnreadable : public IoError {
 public:
  using IoError::IoError;
};

/// Copies `from`/`path` to `to`/`path` and makes the folders that it needs. Gives the digest of
/// what was copied. The copy has the mode 0640, its folders 0750. Not forced to the disk.
/// @throws SourceUnreadable; IoError if the copy cannot be written; Interrupted
[[nodiscard]] FileDigest Copy(const std::filesystem::path& from, const std::filesystem::path& to,
                              const std::string& path, const std::stop_token& stop);

/// The same, but where the file system can (btrfs, XFS) the copy shares the blocks of the original
/// until one of them is written to. Never a second name of the same file: what damages one would
/// damage the other.
[[nodiscard]] FileDigest CloneOrCopy(const std::filesystem::path& from,
                                     const std::filesystem::path& to, const std::string& path,
                                     const std::stop_token& stop);

/// Forces everything on a folder's disk to it. @throws IoError
void SyncDisk(const std::filesystem::path& folder);

}  // namespace plumb
