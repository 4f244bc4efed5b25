// SPDX-License-Identifier: Apache-2.0
// One open virtual unit, which plays the stage to its two streams.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "drivers/simulator/player/stage.hpp"
#include "drivers/simulator/player/sweep_player.hpp"
#include "tests/devices/openni_plugin/oni_driver.hpp"
#include "tests/devices/openni_plugin/virtual_stream.hpp"

namespace plumb::simulated {

/// Both streams get a frame per period while both run. Registration is effective only if it is set
/// after the streams started, as with real units; without it depth is displaced by some columns.
class VirtualDevice : public oni::driver::DeviceBase {
 public:
  VirtualDevice(std::shared_ptr<Unit> unit, const std::shared_ptr<const Stage>& stage);

  OniStatus getSensorInfoList(OniSensorInfo** sensors, int* count) override;
  oni::driver::StreamBase* createStream(OniSensorType type) override;
  void destroyStream(oni::driver::StreamBase* stream) override;
  OniBool isPropertySupported(int id) override;
  OniStatus getProperty(int id, void* data, int* size) override;
  OniStatus setProperty(int id, const void* data, int size) override;
  OniBool isImageRegistrationModeSupported(OniImageRegistrationMode) override { return TRUE; }

 private:
  void Emit(const PlayedPair& pair);
  [[nodiscard]] bool StreamsRun();

  const std::shared_ptr<Unit> unit_;
  const FrameCacheShape shape_;
  OniVideoMode modes_[2];
  OniSensorInfo sensors_[2];
  std::atomic<int> registration_{ONI_IMAGE_REGISTRATION_OFF};

  std::mutex mutex_;  ///< Guards the list of streams.
  std::vector<VirtualStream*> streams_;
  /// Last member: its thread ends before the others are destroyed.
  std::unique_ptr<SweepPlayer> player_;
};

}  // namespace plumb::simulated
