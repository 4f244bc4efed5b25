// SPDX-License-Identifier: Apache-2.0
#include "drivers/freenect/freenect_sensor.hpp"

#include <string>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/live/sensor_calibration.hpp"
#include "drivers/sdk/sdk_sensor.hpp"
#include "words/recording.hpp"
#include "words/sdk.hpp"

namespace plumb::freenect {
namespace {

constexpr int kKinectWidth = 640, kKinectHeight = 480;
// The Kinect stamps images of both streams with a counter of 60 MHz.
constexpr std::int64_t kTicksPerMicrosecond = 60;

bool IsUsable(const FrameMode& mode, int bytes_per_pixel) {
  return mode.is_valid != 0 && mode.width == kKinectWidth && mode.height == kKinectHeight &&
         mode.bytes == kKinectWidth * kKinectHeight * bytes_per_pixel;
}

}  // namespace

FreenectStreams::FreenectStreams(std::shared_ptr<FreenectHost> host, const std::string& serial,
                                 std::shared_ptr<FrameBox> box)
    : host_(std::move(host)), box_(std::move(box)) {
  host_->Do([&] { Start(serial); });
}

FreenectStreams::~FreenectStreams() {
  host_->Do([this] {
    const FreenectLibrary& library = host_->functions();
    (void)library.stop_depth(device_);
    (void)library.stop_video(device_);
    (void)library.close_device(device_);
    host_->CountOpen(-1);
  });
}

void FreenectStreams::Start(const std::string& serial) {
  const FreenectLibrary& library = host_->functions();
  const FrameMode depth = library.find_depth_mode(kResolutionMedium, kDepthRegistered);
  const FrameMode color = library.find_video_mode(kResolutionMedium, kVideoRgb);
  const std::string& guide = FreenectTitle().guide;
  if (!IsUsable(depth, 2))
    throw DeviceError(say::sdk::NoMode(serial, say::recording::Depth(), kSdkRate_hz, guide));
  if (!IsUsable(color, 3))
    throw DeviceError(say::sdk::NoMode(serial, say::recording::Colour(), kSdkRate_hz, guide));
  const bool is_open =
      library.open_device_by_camera_serial(host_->context(), &device_, serial.c_str()) >= 0;
  if (!is_open) throw DeviceError(say::sdk::NoStart(serial));
  library.set_user(device_, this);
  library.set_depth_callback(device_, [](Device* device, void* image, std::uint32_t stamp) {
    FreenectHost::UserOf<FreenectStreams>(device).Accept(StreamKind::kDepth, image, stamp);
  });
  library.set_video_callback(device_, [](Device* device, void* image, std::uint32_t stamp) {
    FreenectHost::UserOf<FreenectStreams>(device).Accept(StreamKind::kColor, image, stamp);
  });
  const bool has_started = library.set_depth_mode(device_, depth) >= 0 &&
                           library.set_video_mode(device_, color) >= 0 &&
                           library.start_depth(device_) >= 0 && library.start_video(device_) >= 0;
  if (!has_started) {
    (void)library.close_device(device_);
    throw DeviceError(say::sdk::NoStart(serial));
  }
  host_->CountOpen(1);
}

void FreenectStreams::Accept(StreamKind kind, const void* image, std::uint32_t stamp) {
  const bool is_color = kind == StreamKind::kColor;
  const SdkImage sent{.kind = kind,
                      .width = kKinectWidth,
                      .height = kKinectHeight,
                      .row_bytes = std::size_t{kKinectWidth} * (is_color ? 3 : 2),
                      .has_format = true,
                      .data = image};
  if (image == nullptr) return box_->CountDiscarded();
  box_->Add(kind, ticks_.Continue(stamp) / kTicksPerMicrosecond, CopyOf(sent));
}

void FreenectStreams::LockExposure(bool locked) const {
  host_->Do([this, locked] {
    for (const int flag : {kAutoExposure, kAutoWhiteBalance})
      (void)host_->functions().set_flag(device_, flag, locked ? 0 : 1);
  });
}

FreenectSensor::FreenectSensor(std::shared_ptr<FreenectHost> host, SdkOpening opening,
                               const SensorSettings& settings)
    : BoxedSensor(opening.description, opening.box), watched_(std::move(opening.watched)) {
  SetInfo(LiveStreamInfo(settings, opening.description.serial, kKinectWidth, kKinectHeight, 0.0,
                         KnownOfClass(DepthSensor::kStructuredLight)));
  opening.box->Begin(kSdkPairsToSettle);
  streams_ = std::make_unique<FreenectStreams>(std::move(host), opening.description.serial,
                                               std::move(opening.box));
}

}  // namespace plumb::freenect
