// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/player/raw_frame.hpp"

#include <cmath>
#include <span>

namespace plumb::simulated {
namespace {

constexpr float kMaxDepth_mm = 9999.0F;

template <typename Value>
std::span<const std::uint8_t> BytesOf(const Value* values, std::size_t count) {
  return {reinterpret_cast<const std::uint8_t*>(values), count * sizeof(Value)};
}

}  // namespace

bool RawFrame::operator==(const RawFrame& other) const {
  return stamps.color_us == other.stamps.color_us && stamps.depth_us == other.stamps.depth_us &&
         rgb == other.rgb && depth_mm == other.depth_mm;
}

RawFrame MakeRaw(const Frame& frame, double start_time_s) {
  RawFrame raw;
  raw.stamps = {std::llround((frame.color_time_s - start_time_s) * 1e6),
                std::llround((frame.depth_time_s - start_time_s) * 1e6)};
  const cv::Mat color = frame.color_rgb.isContinuous() ? frame.color_rgb : frame.color_rgb.clone();
  raw.rgb.assign(color.ptr(), color.ptr() + color.total() * color.elemSize());
  raw.depth_mm.reserve(frame.depth_m.total());
  for (int y = 0; y < frame.depth_m.rows; ++y) {
    const auto* row = frame.depth_m.ptr<float>(y);
    for (int x = 0; x < frame.depth_m.cols; ++x) {
      const float millimetres = std::round(row[x] * 1000.0F);
      raw.depth_mm.push_back(millimetres <= kMaxDepth_mm ? static_cast<std::uint16_t>(millimetres)
                                                         : 0);
    }
  }
  return raw;
}

void WriteRaw(FileWriter& file, const RawFrame& raw) {
  file.Write(BytesOf(&raw.stamps, 1));
  file.Write(raw.rgb);
  file.Write(BytesOf(raw.depth_mm.data(), raw.depth_mm.size()));
}

}  // namespace plumb::simulated
