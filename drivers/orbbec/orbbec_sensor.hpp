// SPDX-License-Identifier: Apache-2.0
// One open camera of OrbbecSDK, created by the driver.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "drivers/orbbec/orbbec_library.hpp"
#include "drivers/sdk/sdk_sensor.hpp"

namespace plumb::orbbec {

/// One stream of an open camera, in the mode that was chosen for it.
struct OrbbecStream {
  std::shared_ptr<Sensor> sensor;
  std::shared_ptr<Profile> profile;
  int width = 0, height = 0;
  std::size_t rank = 0;  ///< In the order of preference.
};

/// Both streams as the camera sends them: none of the library's filters is used.
class OrbbecStreams {
 public:
  /// Chooses the modes and sets the camera's options. Does not start it.
  /// @throws DeviceError naming the serial
  OrbbecStreams(std::shared_ptr<const OrbbecLibrary> library, std::shared_ptr<Device> device,
                const SdkUnit& unit);
  ~OrbbecStreams();
  OrbbecStreams(const OrbbecStreams&) = delete;
  OrbbecStreams& operator=(const OrbbecStreams&) = delete;

  /// The factory's calibration for both modes. @throws DeviceError
  [[nodiscard]] SdkFactory Factory() const;
  /// From now on images go into the box. @throws DeviceError
  void Start(std::shared_ptr<FrameBox> box);
  /// Exposure of colour; 0: automatic.
  void SetExposure(double exposure_us) const;

 private:
  [[nodiscard]] OrbbecStream Choose(StreamKind kind) const;
  [[nodiscard]] SdkLens Lens(const OrbbecStream& stream, const Message& image) const;
  void SetBool(int property, bool value) const;
  void Accept(const ObFrame* frame);

  const std::shared_ptr<const OrbbecLibrary> library_;
  const std::string serial_;
  const double exposure_unit_us_;
  const std::shared_ptr<Device> device_;
  OrbbecStream color_, depth_;
  std::shared_ptr<FrameBox> box_;
};

class OrbbecSensor : public SdkSensor {
 public:
  /// Starts the streams.
  OrbbecSensor(std::unique_ptr<OrbbecStreams> streams, SdkOpening opening,
               const SensorSettings& settings);

  void LockExposure(bool locked) override;

 private:
  std::unique_ptr<OrbbecStreams> streams_;
};

}  // namespace plumb::orbbec
