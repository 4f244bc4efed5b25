// SPDX-License-Identifier: Apache-2.0
#include "tests/devices/openni_plugin/virtual_stream.hpp"

#include <algorithm>
#include <cmath>

namespace plumb::simulated {
namespace {

constexpr float kHorizontalFov_rad =
    1.0226F;  // as stated by the PS1080 driver: 570.3 pixels at 640 x 480
constexpr float kVerticalFov_rad = 0.79661566F;

}  // namespace

OniVideoMode VirtualStream::Mode(bool depth, const FrameCacheShape& shape) {
  OniVideoMode mode{};
  mode.pixelFormat = depth ? ONI_PIXEL_FORMAT_DEPTH_1_MM : ONI_PIXEL_FORMAT_RGB888;
  mode.resolutionX = static_cast<int>(shape.width);
  mode.resolutionY = static_cast<int>(shape.height);
  mode.fps = static_cast<int>(std::lround(1e6 / shape.period_us));
  return mode;
}

OniStatus VirtualStream::start() {
  running_ = true;
  return ONI_STATUS_OK;
}

void VirtualStream::stop() {
  const std::lock_guard lock(mutex_);
  running_ = false;
}

OniBool VirtualStream::isPropertySupported(int id) {
  switch (id) {
    case ONI_STREAM_PROPERTY_CROPPING:
    case ONI_STREAM_PROPERTY_VIDEO_MODE:
    case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
    case ONI_STREAM_PROPERTY_VERTICAL_FOV:
    case ONI_STREAM_PROPERTY_MIRRORING:
    case ONI_STREAM_PROPERTY_STRIDE:
      return TRUE;
    case ONI_STREAM_PROPERTY_MAX_VALUE:
    case ONI_STREAM_PROPERTY_MIN_VALUE:
      return depth_;
    case ONI_STREAM_PROPERTY_AUTO_EXPOSURE:
    case ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE:
      return !depth_;
    default:
      return FALSE;
  }
}

OniStatus VirtualStream::getProperty(int id, void* data, int* size) {
  if (!isPropertySupported(id)) return ONI_STATUS_NOT_SUPPORTED;
  switch (id) {
    case ONI_STREAM_PROPERTY_CROPPING:
      return Answer(OniCropping{}, data, size);
    case ONI_STREAM_PROPERTY_VIDEO_MODE:
      return Answer(Mode(depth_, shape_), data, size);
    case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
      return Answer(kHorizontalFov_rad, data, size);
    case ONI_STREAM_PROPERTY_VERTICAL_FOV:
      return Answer(kVerticalFov_rad, data, size);
    case ONI_STREAM_PROPERTY_MIRRORING:
      return Answer(mirror_.load(), data, size);
    case ONI_STREAM_PROPERTY_STRIDE:
      return Answer(static_cast<int>(shape_.width * (depth_ ? 2 : 3)), data, size);
    case ONI_STREAM_PROPERTY_MAX_VALUE:
      return Answer(kMaxDepth, data, size);
    case ONI_STREAM_PROPERTY_MIN_VALUE:
      return Answer(0, data, size);
    case ONI_STREAM_PROPERTY_AUTO_EXPOSURE:
      return Answer(auto_exposure_, data, size);
    default:
      return Answer(auto_white_balance_, data, size);
  }
}

OniStatus VirtualStream::setProperty(int id, const void* data, int size) {
  if (!isPropertySupported(id)) return ONI_STATUS_NOT_SUPPORTED;
  switch (id) {
    case ONI_STREAM_PROPERTY_VIDEO_MODE: {
      OniVideoMode wanted{};
      const OniVideoMode mode = Mode(depth_, shape_);
      if (Accept(data, size, wanted) != ONI_STATUS_OK) return ONI_STATUS_BAD_PARAMETER;
      return std::memcmp(&wanted, &mode, sizeof mode) == 0 ? ONI_STATUS_OK
                                                           : ONI_STATUS_NOT_SUPPORTED;
    }
    case ONI_STREAM_PROPERTY_MIRRORING: {
      OniBool mirror = FALSE;
      if (Accept(data, size, mirror) != ONI_STATUS_OK) return ONI_STATUS_BAD_PARAMETER;
      mirror_ = mirror;
      return ONI_STATUS_OK;
    }
    case ONI_STREAM_PROPERTY_AUTO_EXPOSURE:
      return Accept(data, size, auto_exposure_);
    case ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE:
      return Accept(data, size, auto_white_balance_);
    default:
      return ONI_STATUS_NOT_SUPPORTED;
  }
}

void VirtualStream::Copy(const Picture& picture, void* out) const {
  const int width = static_cast<int>(shape_.width), height = static_cast<int>(shape_.height);
  const auto copy_rows = [&](auto pixel, int channels) {
    using Pixel = decltype(pixel);
    const auto* from = reinterpret_cast<const Pixel*>(picture.bytes.data());
    auto* to = static_cast<Pixel*>(out);
    const auto row_size = static_cast<std::ptrdiff_t>(width) * channels;
    for (int y = 0; y < height; ++y, from += row_size, to += row_size) {
      if (!mirror_ && picture.shift == 0) {
        std::copy(from, from + row_size, to);
        continue;
      }
      for (int x = 0; x < width; ++x) {
        const int source = std::min((mirror_ ? width - 1 - x : x) + picture.shift, width - 1);
        std::copy_n(from + static_cast<std::ptrdiff_t>(source) * channels, channels,
                    to + static_cast<std::ptrdiff_t>(x) * channels);
      }
    }
  };
  if (depth_)
    copy_rows(std::uint16_t{}, 1);
  else
    copy_rows(std::uint8_t{}, 3);
}

void VirtualStream::Emit(const Picture& picture) {
  const std::lock_guard lock(mutex_);
  if (!running_) return;
  OniFrame* frame = getServices().acquireFrame();
  if (frame == nullptr) return;
  Copy(picture, frame->data);
  const int half = picture.small ? 2 : 1;
  frame->videoMode = Mode(depth_, shape_);
  frame->width = frame->videoMode.resolutionX /= half;
  frame->height = frame->videoMode.resolutionY /= half;
  frame->stride = frame->width * (depth_ ? 2 : 3);
  frame->dataSize = frame->stride * frame->height;
  frame->frameIndex = picture.frame_index;
  frame->timestamp = picture.stamp_us;
  frame->sensorType = depth_ ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR;
  frame->croppingEnabled = FALSE;
  frame->cropOriginX = frame->cropOriginY = 0;
  raiseNewFrame(frame);
  getServices().releaseFrame(frame);
}

}  // namespace plumb::simulated
