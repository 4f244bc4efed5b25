// SPDX-License-Identifier: Apache-2.0
// Frames in the format of a sensor of the Xtion class: RGB and depth in whole millimetres.
#pragma once

#include <cstdint>
#include <vector>

#include "algo/types/frame.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/simulator/player/frame_cache.hpp"

namespace plumb::simulated {

struct RawFrame {
  CachedStamps stamps;
  std::vector<std::uint8_t> rgb;
  /// Below 10000, because the recorder of OpenNI2 damages larger values; larger depth is 0 (not
  /// measured).
  std::vector<std::uint16_t> depth_mm;
  [[nodiscard]] bool operator==(const RawFrame& other) const;
};

/// @param start_time_s  Origin of the cached stamps.
[[nodiscard]] RawFrame MakeRaw(const Frame& frame, double start_time_s);

/// The next record of a frame cache. @throws IoError
void WriteRaw(FileWriter& file, const RawFrame& raw);

}  // namespace plumb::simulated
