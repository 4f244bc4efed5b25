// SPDX-License-Identifier: Apache-2.0
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

/// This process did not run for as long as a sensor may be silent. That says nothing about the
/// sensor, which can still be read, but the recording has a gap.
class ProcessStalled : public DeviceError {
 public:
  using DeviceError::DeviceError;
};

/// A sensor that is attached at present.
struct SensorDescription {
  std::string uri;     ///< Assigned by the driver; changes on each re-plug.
  std::string serial;  ///< Identifies the unit; the URI if the unit has no serial.
  std::string name;
  std::uint16_t usb_vendor = 0;  ///< 0 if unknown.
  std::uint16_t usb_product = 0;
  bool operator==(const SensorDescription&) const = default;
};

/// Counters since the streams started.
struct SensorStatistics {
  std::int64_t num_pairs = 0;      ///< Pairs returned by Next().
  std::int64_t num_unpaired = 0;   ///< Images of either stream without a partner close in time.
  std::int64_t num_discarded = 0;  ///< Images of the wrong size, duplicates or out of order.
  /// Images that were taken but never arrived, because the library keeps only the newest of each
  /// stream.
  std::int64_t num_lost = 0;
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

/// An open, streaming sensor. Next() must be called from one thread; Interrupt(), Flush() and
/// statistics() may be called from any.
class LiveSensor : public FrameSource {
 public:
  [[nodiscard]] virtual const SensorDescription& description() const = 0;
  [[nodiscard]] virtual SensorStatistics statistics() const = 0;

  /// Makes a waiting Next() and all later calls return nothing, immediately and without blocking.
  virtual void Interrupt() noexcept = 0;

  /// Pairs that arrived before this call are dropped, so that a scan begins with images taken after
  /// the button was pressed.
  virtual void Flush() noexcept = 0;

  /// Fixes exposure and white balance (true, during a scan) or lets them adapt (false), if the
  /// sensor supports it.
  virtual void LockExposure(bool locked) = 0;

  // Next() throws DeviceLost once the sensor is unplugged, DeviceError if no pair arrives within
  // the stall time or the driver reports an error, and ProcessStalled if this process did not run
  // for that long.
};

/// The sensors of one library. All functions must be called from one thread; the listener is called
/// on the driver's own.
class SensorProvider {
 public:
  virtual ~SensorProvider() = default;

  /// Attached sensors, each once, ordered by serial.
  [[nodiscard]] virtual std::vector<SensorDescription> List() = 0;

  /// Called from a thread of the driver after a sensor was plugged in, unplugged or changed. It
  /// must not call back but post to the loop.
  virtual void SetListener(std::function<void()> changed) = 0;

  /// Opens a sensor and starts its streams.
  /// @param serial  Empty: the first one.
  /// @throws DeviceError naming the serial and the driver's message, with a remedy where one is
  ///         known.
  [[nodiscard]] virtual std::unique_ptr<LiveSensor> Open(const std::string& serial) = 0;
};

}  // namespace plumb
