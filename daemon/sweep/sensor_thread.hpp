// SPDX-License-Identifier: Apache-2.0
// The thread that owns the sensor: finds, opens and reads it, and finds it again after it was
// unplugged.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/pipeline/live_feed.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

struct SensorThreadOptions {
  std::string serial;  ///< Use only this unit; empty: the first one.
  /// Of another unit, which delivers to the feeds that are of no sweep, too. With it, the first one
  /// delivers to such a feed again after it was unplugged.
  std::string second_serial = {};
  /// Called on the sensor thread when a scan begins, just before waiting for its first frame. May
  /// throw DeviceError.
  std::function<void()> before_scan;
  std::chrono::milliseconds first_retry{500};  ///< After a failure; doubles up to `last_retry`.
  std::chrono::milliseconds last_retry{4000};
};

/// An event of the sensor.
struct SensorEvent {
  enum class Kind { kReady, kLost, kFailed, kOthers, kStalled };
  Kind kind = Kind::kLost;
  SensorDescription sensor;  ///< kReady, kOthers, and kFailed if known.
  Message reason;            ///< kFailed: with a remedy. kStalled.
  std::vector<std::string>
      others;  ///< kReady, kOthers: serials of units that are attached and not used.
};

/// Present state of the sensor.
struct SensorSnapshot {
  bool present = false;  ///< Frames arrive.
  SensorDescription sensor;
  SensorStatistics statistics;
  StreamInfo info;
  /// Serials of units that are attached and not used; not updated while a scan runs.
  std::vector<std::string> others;
};

/// Reads continuously, so that an unplugged or stalled sensor is also noticed between scans. During
/// a scan the frames go to its feed; otherwise only the newest is kept, for a preview. All
/// functions are thread-safe; only the destructor waits for the sensor.
class SensorThread {
 public:
  /// @param make_provider  Called on the sensor thread, again after it threw DeviceError.
  /// @param notify  Called on the sensor thread for each event; it posts to the loop. kReady comes
  ///         with the first frame, kOthers when the set of unused units has changed, kStalled when
  ///         the process did not run: the sensor stays, but a running scan's feed fails.
  SensorThread(std::function<std::unique_ptr<SensorProvider>()> make_provider,
               SensorThreadOptions options, std::function<void(const SensorEvent&)> notify);
  ~SensorThread();
  SensorThread(const SensorThread&) = delete;
  SensorThread& operator=(const SensorThread&) = delete;

  /// From now on frames go to the feed, but not those that arrived earlier. Exposure is fixed until
  /// EndScan(). For a sweep `before_scan` is called. A sensor that was unplugged meanwhile, or
  /// another one, delivers nothing to the feed.
  void BeginScan(std::shared_ptr<LiveFeed> feed, bool is_sweep = true);
  /// Closes the feed.
  void EndScan();

  /// As SecondSensor has it. From any thread.
  [[nodiscard]] std::optional<StreamInfo> AwaitSecond(const std::shared_ptr<LiveFeed>& feed,
                                                      std::chrono::milliseconds patience,
                                                      const std::stop_token& stop) const;
  [[nodiscard]] SensorSnapshot snapshot() const;
  /// The newest frame; none without a sensor.
  [[nodiscard]] std::optional<Frame> latest() const;
  /// Steady time in seconds of the thread's last sign of life, several times a second with or
  /// without a sensor, except while the driver lists, opens and closes (seconds on real hardware).
  [[nodiscard]] double heartbeat_s() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
