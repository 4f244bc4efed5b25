// The protocol of plumb-oni-reader, the only process that opens .oni files, on its standard
// output. Same machine, same build: numbers as they lie in memory. The parent trusts nothing of it
// all the same.
#pragma once

#include <cstdint>

namespace plumb::oni {

inline constexpr std::uint32_t kMagic = 0x31494e4f;
inline constexpr std::uint32_t kMaxText = 1024;

/// First of all.
struct Header {
  std::uint32_t magic = kMagic;
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::int32_t num_frames = 0;      ///< Of the depth stream, as the file states it.
  float horizontal_fov_rad = 0.0F;  ///< Of the colour stream; 0: unknown.
};

enum class Kind : std::uint32_t {
  kFrame = 1,  ///< A FrameStamps, RGB (3 bytes a pixel), depth in mm (2 bytes a pixel) follow.
  kEnd = 2,    ///< An End follows, then nothing.
  kError = 3,  ///< A length (4 bytes) and a text follow, then nothing. May come instead of the
               ///< header, after its magic.
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
