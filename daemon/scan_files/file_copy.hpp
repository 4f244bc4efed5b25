// SPDX-License-Identifier: Apache-2.0
// Copies files for backups and computes their digests.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <stop_token>
#include <string>

#include "algo/base/errors.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {

/// The original cannot be read; there was no error of the copy.
class SourceUnreadable : public IoError {
 public:
  using IoError::IoError;
};

/// Copies `from`/`path` to `to`/`path` and creates the necessary folders. Returns the digest of the
/// copied data. The copy has the mode 0640, its folders 0750. Not flushed to the disk.
/// @throws SourceUnreadable; IoError if the copy cannot be written; Interrupted
[[nodiscard]] FileDigest Copy(const std::filesystem::path& from, const std::filesystem::path& to,
                              const std::string& path, const std::stop_token& stop);

/// The same, but if the file system can (btrfs, XFS), the copy shares the blocks of the original
/// until one of them is written to. Never a hard link, because damage to one would damage the
/// other.
[[nodiscard]] FileDigest CloneOrCopy(const std::filesystem::path& from,
                                     const std::filesystem::path& to, const std::string& path,
                                     const std::stop_token& stop);

/// A file that is written piece by piece as Copy() writes its files; its digest is computed
/// meanwhile. Destroyed without Close(), it removes the file.
class DigestingWriter {
 public:
  /// Creates the necessary folders. @throws IoError
  DigestingWriter(const std::filesystem::path& folder, const std::string& path);
  /// @throws IoError
  void Write(std::span<const std::uint8_t> bytes);
  /// @throws IoError
  [[nodiscard]] FileDigest Close();

 private:
  std::filesystem::path target_;
  FileWriter copy_;
  Sha256 hash_;
  FileDigest digest_;
};

/// Writes a small file of a folder durably and in one step. It gets the folder's owner, where the
/// process may set it.
/// @throws IoError
void PlaceFile(const std::filesystem::path& folder, const std::string& name,
               const std::string& text);

/// What root has written into a state folder gets the account that runs plumbd as its owner: a
/// file, or a folder with all that it holds. @throws IoError
void GiveToOwnerOf(const std::filesystem::path& state, const std::filesystem::path& written);

/// Whether the path is the folder or lies in it, by their names.
[[nodiscard]] bool IsBelow(const std::filesystem::path& path, const std::filesystem::path& folder);

}  // namespace plumb
