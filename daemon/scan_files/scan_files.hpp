// SPDX-License-Identifier: Apache-2.0
// The files of a scan on the disk: whether they exist and are as they were stored.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/files/sha256.hpp"

namespace plumb {

/// Result of examining a path.
struct FileLook {
  int error = 0;         ///< As errno; 0: it can be opened for reading.
  bool is_link = false;  ///< With ENOENT: a link without a target.
  bool is_file = false;  ///< A regular file.
  bool is_folder = false;
  std::uint64_t bytes = 0;
};

/// A function, so that a test can simulate a failing disk.
using ExaminePath = std::function<FileLook(const std::filesystem::path&)>;
[[nodiscard]] FileLook LookAt(const std::filesystem::path& path);

/// A file as it was stored. A recording, whose images are many, has one entry for all of them.
struct FileDigest {
  std::string path;  ///< In the scan's folder: "scene/cloud.ply" or "recording".
  std::uint64_t bytes = 0;
  std::string sha256 = {};  ///< Hexadecimal. For a recording: of the list of its files' digests.
  bool operator==(const FileDigest&) const = default;
};

inline constexpr const char* kSceneMarker = "scene/scene.json";
inline constexpr const char* kRecordingFolder = "recording";

/// SHA-256 and length of a file, read in pieces.
/// @throws IoError naming the file; Interrupted.
[[nodiscard]] FileDigest DigestOfFile(const std::filesystem::path& folder, const std::string& path,
                                      const std::stop_token& stop = {});
/// Of all files in scene/ and result/, by path. @throws as above.
[[nodiscard]] std::vector<FileDigest> DigestsOfScan(const std::filesystem::path& folder,
                                                    const std::stop_token& stop = {});
/// Nothing if no images were kept. @throws as above.
[[nodiscard]] std::optional<FileDigest> DigestOfRecording(const std::filesystem::path& folder,
                                                          const std::stop_token& stop = {});

/// Why these files of a scan cannot be used, without reading their content: "scene/cloud.ply is
/// missing". Empty if all exist with their original size.
[[nodiscard]] Message WhyNotThere(const std::filesystem::path& folder,
                                  const std::vector<FileDigest>& files, const ExaminePath& look);

/// The same by their content, for files whose path begins with the prefix.
/// @throws Interrupted
[[nodiscard]] Message WhyNotIntact(const std::filesystem::path& folder,
                                   const std::vector<FileDigest>& files,
                                   std::string_view prefix = {}, const std::stop_token& stop = {});

}  // namespace plumb
