// One open sensor of OpenNI2. OpenNiProvider makes it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "drivers/live/boxed_sensor.hpp"
#include "drivers/openni/openni_library.hpp"
#include "drivers/openni/openni_provider.hpp"

namespace plumb {

/// Frees the handles of one device with its depth and colour stream, in the order that OpenNI2
/// needs.
class OpenNiStreams {
 public:
  /// Opens and creates, sets both to 640x480 at 30 Hz (320x240 where that is refused), not
  /// mirrored, in step. Starts nothing.
  /// @throws DeviceError
  OpenNiStreams(std::shared_ptr<const OpenNiLibrary> library, const SensorDescription& description);
  ~OpenNiStreams();
  OpenNiStreams(const OpenNiStreams&) = delete;
  OpenNiStreams& operator=(const OpenNiStreams&) = delete;

  /// @throws DeviceError
  void Start();

  std::shared_ptr<const OpenNiLibrary> library;
  OniDeviceHandle device = nullptr;
  OniStreamHandle depth = nullptr;
  OniStreamHandle color = nullptr;
  int width = 0;
  int height = 0;

 private:
  void Create();
  void SetModes();
  [[nodiscard]] OniStatus SetMode(OniStreamHandle stream, OniPixelFormat format, int mode_width,
                                  int mode_height) const;
  void Close() noexcept;
  std::string name_;
  bool started_ = false;
};

/// The StreamWaiter reads both streams all the time, so the newest images are at hand when a scan
/// starts and the rate is known.
class OpenNiSensor : public BoxedSensor {
 public:
  /// @param box       The provider reports an unplug or a failure there.
  /// @param provider  Kept alive as long as this sensor.
  OpenNiSensor(std::unique_ptr<OpenNiStreams> streams, std::shared_ptr<FrameBox> box,
               std::shared_ptr<const void> provider, const SensorDescription& description,
               const OpenNiOptions& options);
  ~OpenNiSensor() override;

  void LockExposure(bool locked) override;

  /// For the recorder, which attaches to the streams and wants the stamps.
  [[nodiscard]] const OpenNiStreams& streams() const { return *streams_; }

 private:
  void Accept(StreamKind kind, const OniFrame& frame);

  std::shared_ptr<const void> provider_;
  std::unique_ptr<OpenNiStreams> streams_;
  std::int64_t waiting_ = 0;  ///< At the StreamWaiter.
};

}  // namespace plumb
