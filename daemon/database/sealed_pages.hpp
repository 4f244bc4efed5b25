// SPDX-License-Identifier: Apache-2.0
// The checksum that each page of the database carries in its last eight bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace plumb {

inline constexpr std::size_t kPageBytes = 4096;
/// Bytes that SQLite leaves unused at the end of each page ("reserved bytes", file format 1.3.4).
inline constexpr std::size_t kSealBytes = 8;

using Page = std::span<std::uint8_t, kPageBytes>;
using ConstPage = std::span<const std::uint8_t, kPageBytes>;

/// Writes the checksum. It also covers the page's number (from 1), so that a page in the wrong
/// place is noticed like a changed one.
void SealPage(Page page, std::uint32_t number);
/// Whether the page is as it was written. A change within one group of eight bytes is always
/// noticed; any other change is missed with a probability of 2^-64.
[[nodiscard]] bool IsSealed(ConstPage page, std::uint32_t number);
/// The checksum that the page carries, whether or not it is right.
[[nodiscard]] std::uint64_t SealIn(ConstPage page);

/// A number as the file format stores it, highest byte first.
[[nodiscard]] inline std::uint32_t BigEndian32(const std::uint8_t* bytes) {
  return std::uint32_t{bytes[0]} << 24U | std::uint32_t{bytes[1]} << 16U |
         std::uint32_t{bytes[2]} << 8U | bytes[3];
}

// Offsets in page 1 (file format, 1.3). The application id is the number of the last change:
// SQLite's own counter of changes stands still while there is a log of writes.
inline constexpr std::size_t kReservedAt = 20, kUserVersionAt = 60, kChangesAt = 68;

// The log of writes (file format, 4.1): a header, then frames of a header and a page each.
inline constexpr std::size_t kLogHeaderBytes = 32, kFrameHeaderBytes = 24;

/// The checksum in the headers of a log of writes, in the byte order of this machine.
struct LogSum {
  std::uint32_t a = 0, b = 0;
  /// @param bytes  Their number is a multiple of eight.
  void Add(std::span<const std::uint8_t> bytes);
  /// Reads a sum that is stored in the file.
  [[nodiscard]] static LogSum At(const std::uint8_t* bytes) {
    return {BigEndian32(bytes), BigEndian32(bytes + 4)};
  }
  bool operator==(const LogSum&) const = default;
};

}  // namespace plumb
