// SPDX-License-Identifier: Apache-2.0
// Files and folders whose names no other has.
#pragma once

#include <filesystem>
#include <string>

namespace plumb {

/// A new folder that only this user can read, removed with everything in it at the end.
class TemporaryFolder {
 public:
  /// @param prefix  Of its name.
  /// @throws IoError
  TemporaryFolder(const std::filesystem::path& parent, const std::string& prefix);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// A new, empty file that only this user can read; the caller closes and removes it.
struct UniqueFile {
  std::filesystem::path path;
  int descriptor = -1;  ///< Open for writing, closed on exec.
};

/// @throws IoError
[[nodiscard]] UniqueFile MakeUniqueFile(const std::filesystem::path& folder,
                                        const std::string& prefix,
                                        const std::string& extension = "");

}  // namespace plumb
