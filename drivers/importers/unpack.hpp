// SPDX-License-Identifier: Apache-2.0
// Unpacks what recordings pack, to a size that they state. @throws DataError unless it is that size
// to the byte.
#pragma once

#include <cstdint>
#include <span>

namespace plumb {

/// A frame of lz4.
void UnpackLz4(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out);
/// A frame of Zstandard.
void UnpackZstd(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out);

}  // namespace plumb
