// SPDX-License-Identifier: Apache-2.0
// The formats of binary recordings that Plumb reads itself, told apart by the files' first bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace plumb {

enum class FileFormat { kRosBag, kRosDatabase, kMcap, kMatroska, kSens };

inline constexpr std::string_view kMcapMagic("\x89MCAP0\r\n", 8);

/// So many bytes suffice to recognise a file's format.
inline constexpr std::size_t kFirstBytes = 64;

[[nodiscard]] inline std::optional<FileFormat> FormatOf(std::span<const std::uint8_t> first) {
  const std::string_view text(reinterpret_cast<const char*>(first.data()), first.size());
  if (text.starts_with("#ROSBAG V2.0\n")) return FileFormat::kRosBag;
  if (text.starts_with(kMcapMagic)) return FileFormat::kMcap;
  if (text.starts_with("\x1a\x45\xdf\xa3")) return FileFormat::kMatroska;
  // Any database of SQLite; its reader looks for the tables of a ROS 2 bag.
  if (text.starts_with(std::string_view("SQLite format 3\0", 16))) return FileFormat::kRosDatabase;
  // Version 4, then the length of a name in 8 bytes, of which the upper six are 0.
  constexpr std::string_view kSens("\4\0\0\0", 4), kShort("\0\0\0\0\0\0", 6);
  if (text.starts_with(kSens) && text.size() >= 12 && text.substr(6, 6) == kShort)
    return FileFormat::kSens;
  return std::nullopt;
}

}  // namespace plumb
