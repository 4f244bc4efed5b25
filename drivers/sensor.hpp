// The interface of a live RGB-D sensor of any make.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "algo/base/errors.hpp"
#include "algo/types/frame.hpp"

namespace plumb {

/// This process did not get to run for as long as a sensor may be silent. That says nothing about
/// the sensor, which can be read on; what was being recorded has a gap.
class ProcessStalled : public DeviceError {
 public:
  using DeviceError::DeviceError;
};

/// A sensor that is attached now.
struct SensorDescription {
  std::string uri;     ///< Of the driver; another one after each re-plug.
  std::string serial;  ///< Identifies the unit; the URI where the unit has no serial.
  std::string name;
  std::uint16_t usb_vendor = 0;  ///< 0: unknown.
  std::uint16_t usb_product = 0;
  bool operator==(const SensorDescription&) const = default;
};

/// Counters since the streams started.
struct SensorStatistics {
  std::int64_t num_pairs = 0;      ///< Handed out by Next().
  std::int64_t num_unpaired = 0;   ///< Images of either stream without a partner close in time.
  std::int64_t num_discarded = 0;  ///< Images of the wrong size, doubled or out of order.
  std::int64_t num_lost = 0;  ///< Images that were taken and never came: the library keeps only the
                              ///< newest of each stream.
  double frames_per_second = 0.0;  ///< Over the last second.

  /// The counts since an earlier reading of the same streams.
  [[nodiscard]] SensorStatistics Since(const SensorStatistics& earlier) const {
    return {.num_pairs = num_pairs - earlier.num_pairs,
            .num_unpaired = num_unpaired - earlier.num_unpaired,
            .num_discarded = num_discarded - earlier.num_discarded,
            .num_lost = num_lost - earlier.num_lost,
            .frames_per_second = frames_per_second};
  }
};

/// An open sensor, streaming. Next() belongs to one thread; Interrupt(), Flush() and statistics()
/// may be called from any.
class LiveSensor : public FrameSource {
 public:
  [[nodiscard]] virtual const SensorDescription& description() const = 0;
  [[nodiscard]] virtual SensorStatistics statistics() const = 0;

  /// Makes a waiting Next(), and each one after it, return nothing; at once, without blocking.
  virtual void Interrupt() noexcept = 0;

  /// Pairs that arrived before this call are not handed out any more: a scan begins with what is
  /// seen after the button was pressed.
  virtual void Flush() noexcept = 0;

  /// Exposure and white balance stand still (true, while scanning) or adapt (false), where the
  /// sensor can.
  virtual void LockExposure(bool locked) = 0;

  // Next() throws DeviceLost once the sensor is unplugged, DeviceError if no pair arrives for the
  // stall time or the driver reports an error, ProcessStalled if it did not get to listen for so
  // long.
};

/// The sensors of one library. All functions belong to one thread, but the listener is called on
/// the driver's own.
class SensorProvider {
 public:
  virtual ~SensorProvider() = default;

  /// Attached sensors, each once, in the order of their serials.
  [[nodiscard]] virtual std::vector<SensorDescription> List() = 0;

  /// Called, from a thread of the driver, after a sensor came, went or changed its state. It must
  /// not call back; it posts to the loop.
  virtual void SetListener(std::function<void()> changed) = 0;

  /// Opens a sensor and starts its streams. @param serial  Empty: the first one.
  /// @throws DeviceError naming the serial and what the driver says, with a remedy where one is
  /// known.
  [[nodiscard]] virtual std::unique_ptr<LiveSensor> Open(const std::string& serial) = 0;
};

}  // namespace plumb
