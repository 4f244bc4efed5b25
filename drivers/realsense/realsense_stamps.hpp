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
  /// frame_ms is by the camera's clock; else by the computer's, as without the metadata.
  bool frame_is_by_camera = true;
  std::optional<std::int64_t> exposure_us;
};

/// One clock is used for both streams: the middle of the exposure if both state it, else the frame
/// stamps, if both are by the same clock. Thread-safe, as each stream has a thread of the
/// library's.
class RealSenseStamps {
 public:
  /// Nothing for images before the other stream's first one, and for those that lack what the
  /// stream's first one had.
  [[nodiscard]] std::optional<std::int64_t> StampOf(StreamKind kind, const StatedTime& stated) {
    const std::lock_guard lock(mutex_);
    std::optional<Clocks>& mine = first_[kind == StreamKind::kColor ? 0 : 1];
    if (!mine) mine = {stated.sensor_us.has_value(), stated.frame_is_by_camera};
    if (!first_[0] || !first_[1]) return std::nullopt;
    if (first_[0]->has_sensor_time && first_[1]->has_sensor_time)
      return stated.sensor_us ? std::optional(counter_.Continue(*stated.sensor_us)) : std::nullopt;
    if (first_[0]->frame_is_by_camera != first_[1]->frame_is_by_camera) return std::nullopt;
    if (!std::isfinite(stated.frame_ms) || std::abs(stated.frame_ms) > 1e15) return std::nullopt;
    return std::llround(1e3 * stated.frame_ms) - stated.exposure_us.value_or(0) / 2;
  }

  /// The stream that lacks the camera's clock where the other one has it: no image of the two can
  /// be paired. Nothing before both streams' first images.
  [[nodiscard]] std::optional<StreamKind> LacksClock() {
    const std::lock_guard lock(mutex_);
    if (!first_[0] || !first_[1]) return std::nullopt;
    const bool by_sensor = first_[0]->has_sensor_time && first_[1]->has_sensor_time;
    if (by_sensor || first_[0]->frame_is_by_camera == first_[1]->frame_is_by_camera)
      return std::nullopt;
    return first_[0]->frame_is_by_camera ? StreamKind::kDepth : StreamKind::kColor;
  }

 private:
  struct Clocks {
    bool has_sensor_time = false, frame_is_by_camera = true;
  };
  std::mutex mutex_;
  std::array<std::optional<Clocks>, 2> first_;  ///< Of the first image of colour and of depth.
  CounterClock counter_;  ///< The camera counts microseconds in 32 bits, for 71 minutes.
};

}  // namespace plumb::realsense
