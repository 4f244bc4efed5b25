// SPDX-License-Identifier: Apache-2.0
// One open sensor of OpenNI2, created by OpenNiProvider.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "drivers/live/boxed_sensor.hpp"
#include "drivers/openni/openni_library.hpp"
#include "drivers/openni/openni_options.hpp"

namespace plumb {

/// Releases the handles of one device and its depth and colour streams in the order that OpenNI2
/// requires.
class OpenNiStreams {
 public:
  /// Opens the device and creates both streams with 640x480 at 30 Hz (320x240 if that is refused),
  /// not mirrored and synchronised. Does not start them.
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

/// The StreamWaiter reads both streams all the time, so that the newest images are available when a
/// scan starts and the rate is known.
class OpenNiSensor : public BoxedSensor {
 public:
  /// @param box       Receives unplug events and failures from the provider.
  /// @param provider  Kept alive as long as this sensor.
  OpenNiSensor(std::unique_ptr<OpenNiStreams> streams, std::shared_ptr<FrameBox> box,
               std::shared_ptr<const void> provider, const SensorDescription& description,
               const OpenNiOptions& options);
  ~OpenNiSensor() override;

  void LockExposure(bool locked) override;

  /// For the recorder, which attaches to the streams and needs the stamps.
  [[nodiscard]] const OpenNiStreams& streams() const { return *streams_; }

 private:
  void Accept(StreamKind kind, const OniFrame& frame);

  std::shared_ptr<const void> provider_;
  std::unique_ptr<OpenNiStreams> streams_;
  std::int64_t waiting_ = 0;  ///< Token of the StreamWaiter.
};

}  // namespace plumb
