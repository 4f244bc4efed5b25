// SPDX-License-Identifier: Apache-2.0
// The part of a live sensor that all drivers share: pairs come from a FrameBox.
#pragma once

#include <memory>
#include <optional>
#include <utility>

#include "drivers/live/frame_box.hpp"
#include "drivers/replay/registration.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

/// The driver's thread puts images into the box: CV_8UC3 as RGB and CV_16UC1 in millimetres, unless
/// SetDepth() states another unit.
class BoxedSensor : public LiveSensor {
 public:
  [[nodiscard]] const SensorDescription& description() const override { return description_; }
  [[nodiscard]] SensorStatistics statistics() const override { return box_->statistics(); }
  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] std::optional<Frame> Next() override {
    std::optional<FrameBox::Pair> pair = box_->Take();
    if (!pair) return std::nullopt;
    Frame frame;
    frame.index = pair->index;
    frame.color_time_s = 1e-6 * static_cast<double>(pair->images.color_us);
    frame.depth_time_s = 1e-6 * static_cast<double>(pair->images.depth_us);
    frame.color_rgb = std::move(pair->images.color);
    frame.depth_m = DepthInMetres(pair->images.depth, units_per_metre_);
    if (registration_) frame.depth_m = registration_->Register(frame.depth_m);
    return frame;
  }
  void Interrupt() noexcept override { box_->Interrupt(); }
  void Flush() noexcept override { box_->Flush(); }

  [[nodiscard]] FrameBox& box() { return *box_; }

 protected:
  BoxedSensor(SensorDescription description, std::shared_ptr<FrameBox> box)
      : description_(std::move(description)), box_(std::move(box)) {}
  void SetInfo(StreamInfo info) { info_ = std::move(info); }
  /// @param registration  Of depth that has a camera of its own.
  void SetDepth(double units_per_metre, std::optional<DepthRegistration> registration) {
    units_per_metre_ = units_per_metre;
    registration_ = std::move(registration);
  }

 private:
  SensorDescription description_;
  std::shared_ptr<FrameBox> box_;
  StreamInfo info_;
  double units_per_metre_ = 1000.0;
  std::optional<DepthRegistration> registration_;
};

}  // namespace plumb
