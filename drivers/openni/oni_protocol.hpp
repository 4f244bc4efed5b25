// SPDX-License-Identifier: Apache-2.0
// The protocol on the standard output of plumb-oni-reader, the only process that opens .oni files.
// Both ends are on the same machine and from the same build, so numbers are in memory
// representation. The parent nevertheless validates everything.
#pragma once

#include <cstdint>

namespace plumb::oni {

inline constexpr std::uint32_t kMagic = 0x31494e4f;

/// The first bytes.
struct Header {
  std::uint32_t magic = kMagic;
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::int32_t num_frames = 0;      ///< Of the depth stream, as stated by the file.
  float horizontal_fov_rad = 0.0F;  ///< Of the colour stream; 0 if unknown.
};

enum class Kind : std::uint32_t {
  /// Followed by a FrameStamps, RGB (3 bytes per pixel), depth in mm (2 bytes per pixel).
  kFrame = 1,
  kEnd = 2,  ///< Followed by an End, then nothing.
  /// Followed by a length (4 bytes) and a text, then nothing. May replace the header after its
  /// magic.
  kError = 3,
};

struct FrameStamps {
  std::int64_t color_us = 0;
  std::int64_t depth_us = 0;
};

struct End {
  std::int64_t num_unpaired = 0;
  std::int64_t num_discarded = 0;
};

}  // namespace plumb::oni
