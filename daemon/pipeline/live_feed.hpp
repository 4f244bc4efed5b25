// SPDX-License-Identifier: Apache-2.0
// Passes live frames from the sensor thread to the tracking thread.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/loop/bounded_queue.hpp"
#include "daemon/pipeline/frame_feed.hpp"

namespace plumb {

/// A bounded queue that drops its oldest frame when tracking is late. All functions are
/// thread-safe.
class LiveFeed : public FrameFeed {
 public:
  explicit LiveFeed(std::size_t capacity) : queue_(capacity) {}

  /// Called on the sensor's thread; never waits.
  /// @param sensor  Which of several.
  void Push(Frame frame, std::size_t sensor = 0) {
    const std::lock_guard lock(mutex_);
    // arrived after the end of the sweep, so it does not belong to it and is not lost
    if (closed_) return;
    last_frame_s_ = SteadySeconds();
    dropped_ += queue_.PushDroppingOldest({std::move(frame), last_frame_s_, sensor});
    ++num_pushed_;
  }
  /// No more frames follow; waiting ones are still delivered.
  void Close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    queue_.Close();
  }

  /// The frames are not a complete sweep, for this reason; Next() throws it. Without effect once
  /// closed.
  void Fail(Message why) {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    failure_ = std::move(why);
    closed_ = true;
    queue_.Close();
  }

  [[nodiscard]] std::int64_t num_pushed() const { return num_pushed_; }
  /// Which sensor it is of; only for who calls Next().
  [[nodiscard]] std::size_t taken_sensor() const { return taken_sensor_; }

  /// @throws DeviceError after Fail().
  std::optional<Frame> Next(const std::stop_token& stop) override {
    std::optional<Arrived> arrived = queue_.Pop(stop);
    if (!arrived) {
      ThrowFailure();
      return std::nullopt;
    }
    taken_arrived_s_ = arrived->time_s;
    taken_sensor_ = arrived->sensor;
    return std::move(arrived->frame);
  }
  int TakeDropped() override { return dropped_.exchange(0); }
  void Finish() override {}
  [[nodiscard]] std::optional<double> last_frame_s() const override { return last_frame_s_; }
  [[nodiscard]] std::optional<double> taken_arrived_s() const override { return taken_arrived_s_; }

 private:
  void ThrowFailure() {
    const std::lock_guard lock(mutex_);
    if (!failure_.empty()) throw DeviceError(failure_);
  }

  struct Arrived {
    Frame frame;
    double time_s = 0.0;
    std::size_t sensor = 0;
  };
  BoundedQueue<Arrived> queue_;
  std::mutex mutex_;  // guards pushing and closing
  bool closed_ = false;
  Message failure_;
  std::size_t taken_sensor_ = 0;
  std::atomic<int> dropped_ = 0;
  std::atomic<std::int64_t> num_pushed_ = 0;
  std::atomic<double> last_frame_s_ = 0.0, taken_arrived_s_ = 0.0;
};

}  // namespace plumb
