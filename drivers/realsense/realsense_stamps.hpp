// SPDX-License-Identifier: Apache-2.0
// Stamps of images at mid-exposure, of one clock for both streams, from what a RealSense states.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <optional>

#include "drivers/live/frame_pairing.hpp"
#include "drivers/sdk/counter_clock.hpp"

namespace plumb::realsense {

/// What the library states of one image's time.
struct StatedTime {
  /// The middle of the exposure by the camera's clock, if the system delivers the metadata.
  std::optional<std::int64_t> sensor_us;
  double frame_ms = 0.0;  ///< When its transmission began, or when it arrived.
  std::optional<std::int64_t> exposure_us;
};

/// One clock is used for both streams: the camera's if both state it, else that of the frame
/// stamps. Thread-safe, as each stream has a thread of the library's.
class RealSenseStamps {
 public:
  /// Nothing for images before the other stream's first one, and for those that lack what the
  /// stream's first one had.
  [[nodiscard]] std::optional<std::int64_t> StampOf(StreamKind kind, const StatedTime& stated) {
    const std::lock_guard lock(mutex_);
    std::optional<bool>& mine = has_sensor_time_[kind == StreamKind::kColor ? 0 : 1];
    if (!mine) mine = stated.sensor_us.has_value();
    if (!has_sensor_time_[0] || !has_sensor_time_[1]) return std::nullopt;
    if (*has_sensor_time_[0] && *has_sensor_time_[1])
      return stated.sensor_us ? std::optional(counter_.Continue(*stated.sensor_us)) : std::nullopt;
    if (!std::isfinite(stated.frame_ms) || std::abs(stated.frame_ms) > 1e15) return std::nullopt;
    return std::llround(1e3 * stated.frame_ms) - stated.exposure_us.value_or(0) / 2;
  }

 private:
  std::mutex mutex_;
  std::array<std::optional<bool>, 2> has_sensor_time_;  ///< Of colour and depth.
  CounterClock counter_;  ///< The camera counts microseconds in 32 bits, for 71 minutes.
};

}  // namespace plumb::realsense
