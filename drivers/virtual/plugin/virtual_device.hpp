// One open virtual unit: plays the stage to its two streams.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "drivers/virtual/plugin/oni_driver.hpp"
#include "drivers/virtual/plugin/stage.hpp"
#include "drivers/virtual/plugin/virtual_stream.hpp"

namespace plumb::simulated {

/// A thread of its own gives both streams a frame each period while both run. Registration holds
/// only if it is set after the streams started, as with real units; without it depth is off by some
/// columns.
class VirtualDevice : public oni::driver::DeviceBase {
 public:
  VirtualDevice(std::shared_ptr<Unit> unit, std::shared_ptr<const Stage> stage);
  ~VirtualDevice() override;

  OniStatus getSensorInfoList(OniSensorInfo** sensors, int* count) override;
  oni::driver::StreamBase* createStream(OniSensorType type) override;
  void destroyStream(oni::driver::StreamBase* stream) override;
  OniBool isPropertySupported(int id) override;
  OniStatus getProperty(int id, void* data, int* size) override;
  OniStatus setProperty(int id, const void* data, int size) override;
  OniBool isImageRegistrationModeSupported(OniImageRegistrationMode) override { return TRUE; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Shown {
    CachedStamps stamps;
    int frame_index = 0;
  };
  void Run(const std::stop_token& stop);
  void Tick(const std::stop_token& stop);
  void Give(const Shown& shown, const std::stop_token& stop);
  void EmitBoth(const Shown& shown, bool small, bool depth_only);
  void Load(std::uint32_t frame);
  [[nodiscard]] bool StreamsRun();
  void SleepUntil(Clock::time_point time, const std::stop_token& stop);

  const std::shared_ptr<Unit> unit_;
  const std::shared_ptr<const Stage> stage_;
  OniVideoMode modes_[2];
  OniSensorInfo sensors_[2];
  std::atomic<int> registration_{ONI_IMAGE_REGISTRATION_OFF};

  std::mutex mutex_;  ///< Of the list of streams.
  std::condition_variable_any wake_;
  std::vector<VirtualStream*> streams_;

  // Of the thread.
  Stage::View view_;
  std::vector<std::uint8_t> rgb_;
  std::vector<std::uint16_t> depth_mm_;
  CachedStamps loaded_stamps_;
  std::int64_t loaded_frame_ = -1;
  std::uint32_t next_ = 0;  ///< Position in the scene.
  int wait_ticks_ = 0;  ///< Before a sweep, so that what was on its way is not taken for its begin.
  std::int64_t device_us_ = 1000000;  ///< The unit's own clock.
  std::int64_t sweep_begin_us_ = 0;
  int frame_index_ = 0;
  Clock::time_point due_;
  std::jthread thread_;  ///< Last: joined before the others go.
};

}  // namespace plumb::simulated
