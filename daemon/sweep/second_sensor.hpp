// SPDX-License-Identifier: Apache-2.0
// The second sensor of live monitoring: opened while there is a feed for it, read on a thread of
// its own, and opened again after it was unplugged.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "daemon/pipeline/live_feed.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

/// Its frames are pushed as those of sensor 1. Used on the thread that owns the provider, but for
/// AwaitInfo(), which may be called from any.
class SecondSensor {
 public:
  /// @param serial  Empty: there is none, and nothing happens.
  explicit SecondSensor(std::string serial) : serial_(std::move(serial)) {}
  ~SecondSensor() { Close(); }
  SecondSensor(const SecondSensor&) = delete;
  SecondSensor& operator=(const SecondSensor&) = delete;

  [[nodiscard]] const std::string& serial() const { return serial_; }
  /// Called often: opens it for the feed, or closes it. Opening takes seconds on real hardware. A
  /// failure is no error: it is tried again.
  /// @param provider  Null: there is none yet.
  void Tend(SensorProvider* provider, const std::shared_ptr<LiveFeed>& feed);
  void Close();
  /// Waits until it is open for the feed; nothing if it is not in time.
  [[nodiscard]] std::optional<StreamInfo> AwaitInfo(const std::shared_ptr<LiveFeed>& feed,
                                                    std::chrono::milliseconds patience,
                                                    const std::stop_token& stop);

 private:
  void Read(const std::stop_token& stop, LiveSensor& sensor, LiveFeed& feed);

  const std::string serial_;
  std::shared_ptr<LiveFeed> feed_;
  std::shared_ptr<LiveSensor> sensor_;
  std::chrono::steady_clock::time_point retry_at_;
  std::mutex mutex_;
  std::condition_variable_any opened_;
  std::optional<StreamInfo> info_;         ///< Guarded.
  std::weak_ptr<const LiveFeed> info_of_;  ///< Guarded: opened for this one.
  std::atomic<bool> has_ended_ = false;    ///< The thread, because of the sensor.
  std::jthread thread_;
};

}  // namespace plumb
