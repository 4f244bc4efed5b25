// SPDX-License-Identifier: Apache-2.0
// Reads and writes whole files, with Plumb's exceptions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "algo/base/message.hpp"
#include "drivers/files/descriptor.hpp"

namespace plumb {

/// The bytes of a regular file. Never blocks on a pipe or device in place of a file.
/// @throws DataError if the file is missing, unreadable, not a regular file or longer than
///         `max_bytes`.
[[nodiscard]] std::vector<std::uint8_t> ReadWholeFile(const std::filesystem::path& path,
                                                      std::size_t max_bytes);

/// The same as text.
[[nodiscard]] std::string ReadTextFile(const std::filesystem::path& path, std::size_t max_bytes);

/// A new file, written through one buffer. The owner calls Close(); destroyed without it (by an
/// exception), a writer removes its file, unless the file is a device or a pipe. Not thread-safe.
class FileWriter {
 public:
  /// Creates or truncates the file. @throws IoError
  explicit FileWriter(std::filesystem::path path);
  ~FileWriter();
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;

  /// @throws IoError, with the advice to free space when the disk is full.
  void Write(std::span<const std::uint8_t> bytes);
  void Write(std::string_view text);

  /// Writes the buffer and closes. @throws IoError
  void Close();

 private:
  void Flush();
  void Discard();
  void WriteThrough(std::span<const std::uint8_t> bytes);

  std::filesystem::path path_;
  int descriptor_ = -1;
  bool regular_ = false;
  std::vector<std::uint8_t> buffer_;
};

/// Creates or replaces a file. A failed write leaves no file behind. Not atomic: see
/// daemon/files/atomic_folder.hpp.
/// @throws IoError
void WriteWholeFile(const std::filesystem::path& path, std::span<const std::uint8_t> bytes);
void WriteWholeFile(const std::filesystem::path& path, std::string_view text);

/// Forces a file's or a folder's contents to the disk. @throws IoError
void SyncToDisk(const std::filesystem::path& path);
/// The same for everything on the disk of a file or folder.
void SyncWholeDisk(const std::filesystem::path& path);

/// Writes all bytes, in as many calls as it takes. @param path  Named in the error.
/// @throws IoError with the text of DescribeWriteError().
void WriteAll(const Descriptor& file, std::string_view bytes, const std::filesystem::path& path);

/// "cannot write FILE: REASON", with advice where it is known (ENOSPC, EDQUOT, EFBIG, EACCES,
/// EROFS).
[[nodiscard]] Message DescribeWriteError(const std::filesystem::path& path, int error_number);

}  // namespace plumb
