// SPDX-License-Identifier: Apache-2.0
// What a unit remembers of its channels of updates: the newest index of each, so that no older one
// is taken, and the bundles that it fetched itself.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace plumb {

/// In the state folder.
inline constexpr const char* kChannelMemoryFile = "channel.json";

/// Tells a file from another one that took its place or was written into it. Neither another name
/// nor RAUC, which makes a bundle root's, changes the stamp.
struct FileStamp {
  std::uint64_t inode = 0, bytes = 0;
  std::int64_t modified_ns = 0;
  bool operator==(const FileStamp&) const = default;
};
/// Nothing if it is no regular file.
[[nodiscard]] std::optional<FileStamp> StampOf(const std::filesystem::path& file);

struct FetchedBundle {
  std::string name, sha256;
  FileStamp stamp;
};

struct ChannelMemory {
  std::map<std::string, std::int64_t> newest = {};  ///< Number of an index, by channel and key.
  /// Those that lie in the folder, and those that a person removed there.
  std::vector<FetchedBundle> fetched = {};
};

/// The name under which the number of a channel's newest index is kept. It contains the key,
/// because the numbers start again when another key signs the index.
[[nodiscard]] std::string NameOfOrder(const std::string& channel, const std::string& key);

/// Empty where there is no file yet.
/// @throws DataError naming a file that cannot be read: its numbers are not taken for zero.
[[nodiscard]] ChannelMemory ReadChannelMemory(const std::filesystem::path& state);
/// Durably, and in one step. @throws IoError
void KeepChannelMemory(const std::filesystem::path& state, const ChannelMemory& memory);

}  // namespace plumb
