// SPDX-License-Identifier: Apache-2.0
// One open camera of librealsense2, created by the driver.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/realsense/realsense_library.hpp"
#include "drivers/realsense/realsense_stamps.hpp"
#include "drivers/sdk/sdk_sensor.hpp"

namespace plumb::realsense {

/// One stream of an open camera: the mode that was chosen for it.
struct ChosenMode {
  Sensor* sensor = nullptr;
  const Profile* profile = nullptr;
  int width = 0, height = 0;
  std::size_t rank = 0;  ///< In the order of preference.
};

/// The handles of one camera and its two streams, as sent by the camera: none of the library's
/// filters is used.
class RealSenseStreams {
 public:
  /// Chooses the modes and sets the camera's options. Does not start it.
  /// @throws DeviceError naming the serial
  RealSenseStreams(std::shared_ptr<const RealSenseLibrary> library,
                   std::shared_ptr<const Device> device, const std::string& serial);
  ~RealSenseStreams();
  RealSenseStreams(const RealSenseStreams&) = delete;
  RealSenseStreams& operator=(const RealSenseStreams&) = delete;

  /// The factory's calibration for both modes. @throws DeviceError
  [[nodiscard]] SdkFactory Factory() const;
  /// From now on images go into the box. @throws DeviceError
  void Start(std::shared_ptr<FrameBox> box);
  /// Exposure of colour; 0: automatic.
  void SetExposure(double exposure_us) const;

 private:
  void FindModes();
  void Consider(Sensor* sensor, const Profile* profile);
  void SetOptions() const;
  void SetOption(const Sensor* sensor, int option, float value) const;
  void Accept(const RsFrame* frame);
  [[nodiscard]] StatedTime TimeOf(const RsFrame* frame) const;
  [[nodiscard]] SdkLens Lens(const RsIntrinsics& camera, const Message& image) const;

  const std::shared_ptr<const RealSenseLibrary> library_;
  const std::string serial_;
  const std::shared_ptr<const Device> device_;
  std::vector<Owned<Sensor>> sensors_;
  std::vector<Owned<ProfileList>> profiles_;
  ChosenMode color_, depth_;
  std::vector<const Sensor*> opened_, started_;
  std::shared_ptr<FrameBox> box_;
  RealSenseStamps stamps_;
};

class RealSenseSensor : public SdkSensor {
 public:
  /// Starts the streams.
  RealSenseSensor(std::unique_ptr<RealSenseStreams> streams, SdkOpening opening,
                  const SensorSettings& settings);

  void LockExposure(bool locked) override;

 private:
  std::unique_ptr<RealSenseStreams> streams_;
};

}  // namespace plumb::realsense
