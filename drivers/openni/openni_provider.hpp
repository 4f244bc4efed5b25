// SPDX-License-Identifier: Apache-2.0
// Sensors of the Xtion / Carmine class through OpenNI2.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "drivers/openni/openni_options.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

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
