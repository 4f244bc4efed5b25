// SPDX-License-Identifier: Apache-2.0
// The number of a database's last confirmed change, kept in a file beside it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace plumb {

/// Appended to the name of the database's file.
inline constexpr const char* kMarkSuffix = "-mark";

/// The number of the last change that was confirmed. The numbers of a database begin at a random
/// one, so that two databases hardly ever share a number. A mark proves that the unit has been in
/// use.
struct DatabaseMark {
  std::uint32_t changes = 0;
};

/// Nothing if there is none, or if it is damaged.
[[nodiscard]] std::optional<DatabaseMark> ReadMark(const std::filesystem::path& database);
/// Not forced to the disk: until SyncMark(), a power cut may leave an earlier change's, but never
/// one that the database does not have. If the mark cannot be written, the old one stays, which is
/// just as harmless.
void WriteMark(const std::filesystem::path& database, const DatabaseMark& mark);
/// Forces the mark to the disk. If the disk refuses, the mark may lag behind, as above.
void SyncMark(const std::filesystem::path& database);

}  // namespace plumb
