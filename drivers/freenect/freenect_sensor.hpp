// SPDX-License-Identifier: Apache-2.0
// One open Kinect.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "drivers/freenect/freenect_host.hpp"
#include "drivers/live/boxed_sensor.hpp"
#include "drivers/sdk/counter_clock.hpp"

namespace plumb::freenect {

/// Both streams of a Kinect, into a box. Depth is registered by the library, with the factory's
/// values.
class FreenectStreams {
 public:
  /// Starts them. @throws DeviceError
  FreenectStreams(std::shared_ptr<FreenectHost> host, const std::string& serial,
                  std::shared_ptr<FrameBox> box);
  ~FreenectStreams();
  FreenectStreams(const FreenectStreams&) = delete;
  FreenectStreams& operator=(const FreenectStreams&) = delete;

  /// Holds exposure and white balance, or lets them adapt.
  void LockExposure(bool locked) const;

 private:
  void Start(const std::string& serial);
  void Accept(StreamKind kind, const void* image, std::uint32_t stamp);

  const std::shared_ptr<FreenectHost> host_;
  const std::shared_ptr<FrameBox> box_;
  Device* device_ = nullptr;
  CounterClock ticks_;
};

class FreenectSensor : public BoxedSensor {
 public:
  FreenectSensor(std::shared_ptr<FreenectHost> host, SdkOpening opening,
                 const SensorSettings& settings);

  void LockExposure(bool locked) override { streams_->LockExposure(locked); }

 private:
  std::shared_ptr<const void> watched_;
  std::unique_ptr<FreenectStreams> streams_;
};

}  // namespace plumb::freenect
