// The thread that owns the sensor: finds it, opens it, reads it, and finds it again after it was
// gone.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/pipeline/live_feed.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

struct SensorThreadOptions {
  std::string serial;  ///< Only this unit; empty: the first one.
  /// Called on the sensor thread when a scan begins, just before its first frame is waited for. May
  /// throw DeviceError.
  std::function<void()> before_scan;
  std::chrono::milliseconds first_retry{500};  ///< After a failure; doubles up to `last_retry`.
  std::chrono::milliseconds last_retry{4000};
};

/// What happened to the sensor.
struct SensorEvent {
  enum class Kind { kReady, kLost, kFailed, kOthers, kStalled };
  Kind kind = Kind::kLost;
  SensorDescription sensor;  ///< kReady, kOthers, and kFailed where known.
  std::string reason;        ///< kFailed: a sentence with a remedy. kStalled: a sentence.
  std::vector<std::string>
      others;  ///< kReady, kOthers: serials of the units that are attached and not used.
};

/// What is known of the sensor now.
struct SensorSnapshot {
  bool present = false;  ///< Frames arrive.
  SensorDescription sensor;
  SensorStatistics statistics;
  StreamInfo info;
  std::vector<std::string> others;  ///< Serials of the units that are attached and not used; not
                                    ///< looked for while a scan runs.
};

/// Reads all the time, so that an unplugged or stalled sensor is noticed while nobody scans, too.
/// While a scan runs the frames go to its feed, otherwise only the newest is kept, for a preview.
/// All functions are thread-safe; none waits for the sensor but the destructor.
class SensorThread {
 public:
  /// @param make_provider  Called on the sensor thread, again after it threw DeviceError.
  /// @param notify  Called on the sensor thread for each event; it posts to the loop. kReady comes
  /// with the first frame, kOthers when the units that are not used became others, kStalled when
  /// the process did not get to run: the sensor stays, but a running scan's feed fails.
  SensorThread(std::function<std::unique_ptr<SensorProvider>()> make_provider,
               SensorThreadOptions options, std::function<void(const SensorEvent&)> notify);
  ~SensorThread();
  SensorThread(const SensorThread&) = delete;
  SensorThread& operator=(const SensorThread&) = delete;

  /// From now on frames go to the feed; those that arrived before do not. Exposure stands still
  /// until EndScan(). Of a sensor that comes back meanwhile, or of another one, the feed gets
  /// nothing.
  void BeginScan(std::shared_ptr<LiveFeed> feed);
  /// Closes the feed.
  void EndScan();

  [[nodiscard]] SensorSnapshot snapshot() const;
  /// The newest frame; none without a sensor.
  [[nodiscard]] std::optional<Frame> latest() const;
  /// Steady seconds at which the thread last showed that it lives. It does so several times a
  /// second, sensor or not, except while the driver lists, opens and closes (seconds on real
  /// hardware).
  [[nodiscard]] double heartbeat_s() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
