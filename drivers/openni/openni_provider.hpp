// Sensors of the Xtion / Carmine class through OpenNI2.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "drivers/live/sensor_driver.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

struct OpenNiOptions : SensorSettings {
  /// libOpenNI2.so.0 to load; its drivers are those in `OpenNI2/Drivers` beside it. Empty: the
  /// system's.
  std::filesystem::path library = {};
  std::chrono::milliseconds stall_time{2000};  ///< Next() fails after this time without a pair.
  std::chrono::microseconds max_gap{
      16000};  ///< Between the stamps of a pair; less than half of the frame period.
  /// Called before the library is stopped, which waits for its drivers' threads under a lock that
  /// their callbacks need: everything that makes a driver call back must stop. Must not throw.
  std::function<void()> before_stop = {};
};

/// Slow operations: List() opens each unit that it has not seen before to read its serial (about a
/// second on real hardware), and Open() starts streams. Call both from a worker thread, not from
/// the event loop.
class OpenNiProvider : public SensorProvider {
 public:
  /// Starts OpenNI2 and its drivers. Block signals before, because they start threads.
  /// @throws DeviceError if the library cannot be loaded or started.
  explicit OpenNiProvider(const OpenNiOptions& options);
  ~OpenNiProvider() override;

  [[nodiscard]] std::vector<SensorDescription> List() override;
  void SetListener(std::function<void()> changed) override;
  /// Sensors may outlive the provider.
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::string& serial) override;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace plumb
