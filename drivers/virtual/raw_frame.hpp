// Frames as a sensor of the Xtion class gives them: RGB and depth in whole millimetres.
#pragma once

#include <cstdint>
#include <vector>

#include "algo/types/frame.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/virtual/frame_cache.hpp"

namespace plumb::simulated {

struct RawFrame {
  CachedStamps stamps;
  std::vector<std::uint8_t> rgb;
  std::vector<std::uint16_t> depth_mm;  ///< Below 10000, where the recorder of OpenNI2 damages
                                        ///< depth; farther is 0, nothing.
  [[nodiscard]] bool operator==(const RawFrame& other) const;
};

/// @param start_time_s  Where the cached stamps begin to count.
[[nodiscard]] RawFrame MakeRaw(const Frame& frame, double start_time_s);

/// The next record of a frame cache. @throws IoError
void WriteRaw(FileWriter& file, const RawFrame& raw);

}  // namespace plumb::simulated
