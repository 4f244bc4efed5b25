// Sensors of the Xtion / Carmine class through OpenNI2.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "drivers/sensor.hpp"

namespace plumb {

struct OpenNiOptions {
  /// libOpenNI2.so.0 to load; its drivers are those in `OpenNI2/Drivers` beside it. Empty: the
  /// system's.
  std::filesystem::path library = {};
  /// Holds `SERIAL.yaml` for each calibrated unit, as camera.yaml; its depth_scale is ignored, live
  /// depth is in millimetres. A unit without one gets nominal intrinsics from its field of view,
  /// and a warning.
  std::filesystem::path calibration_folder = "/var/lib/plumb/calibration";
  std::string marker_dictionary =
      "DICT_6X6_250";  ///< What holds where the calibration file does not say it.
  double marker_length_m = 0.104;
  std::optional<int> reference_marker = {};
  /// The three above are the room's: a calibration file that states other markers is refused. Off
  /// for recordings and the virtual sensor, whose file is all that is known of their markers.
  bool markers_are_the_rooms = false;
  std::chrono::milliseconds stall_time{2000};  ///< Next() fails after so long without a pair.
  std::chrono::microseconds max_gap{
      16000};  ///< Between the stamps of a pair; under half of the frame period.
  /// Called before the library is stopped, which waits for its drivers' threads under a lock that
  /// their callbacks want: anything that makes a driver call back must stop. Must not throw.
  std::function<void()> before_stop = {};
};

/// May take long; call it off the event loop: List() opens each unit that it has not seen before to
/// ask its serial (about a second on real hardware), Open() starts streams. Call both from a worker
/// thread, not from the event loop.
class OpenNiProvider : public SensorProvider {
 public:
  /// Starts OpenNI2 and its drivers. Block signals before: they start threads.
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
