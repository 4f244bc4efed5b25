// SPDX-License-Identifier: Apache-2.0
#include "drivers/openni/openni_sensor.hpp"

#include "algo/base/errors.hpp"
#include "drivers/live/sensor_calibration.hpp"
#include "drivers/openni/stream_waiter.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

constexpr int kFps = 30;
// Registration and exposure take a moment after the start; until then depth may still be on its own
// grid.
constexpr int kPairsToSettle = 2;

/// @return False if the stream does not have this setting.
template <typename Value>
bool Set(const OpenNiLibrary& library, OniStreamHandle stream, int property, const Value& value) {
  return library.StreamIsPropertySupported(stream, property) != FALSE &&
         library.StreamSetProperty(stream, property, &value, sizeof value) == ONI_STATUS_OK;
}

}  // namespace

OpenNiStreams::OpenNiStreams(std::shared_ptr<const OpenNiLibrary> loaded,
                             const SensorDescription& description)
    : library(std::move(loaded)), name_(description.serial) {
  const OniStatus status = library->DeviceOpen(description.uri.c_str(), &device);
  if (status != ONI_STATUS_OK) {
    throw DeviceError(library->Describe(say::sensor::CannotOpen(name_, description.name), status));
  }
  try {
    Create();
    SetModes();
  } catch (...) {
    Close();
    throw;
  }
}

OpenNiStreams::~OpenNiStreams() { Close(); }

void OpenNiStreams::Create() {
  library->Check(say::sensor::NoDepthStream(name_),
                 library->DeviceCreateStream(device, ONI_SENSOR_DEPTH, &depth));
  library->Check(say::sensor::NoColorStream(name_),
                 library->DeviceCreateStream(device, ONI_SENSOR_COLOR, &color));
}

OniStatus OpenNiStreams::SetMode(OniStreamHandle stream, OniPixelFormat format, int mode_width,
                                 int mode_height) const {
  const OniVideoMode mode{format, mode_width, mode_height, kFps};
  return library->StreamSetProperty(stream, ONI_STREAM_PROPERTY_VIDEO_MODE, &mode, sizeof mode);
}

void OpenNiStreams::SetModes() {
  OniStatus status = ONI_STATUS_ERROR;
  for (const auto& [w, h] : {std::pair{640, 480}, std::pair{320, 240}}) {
    status = SetMode(depth, ONI_PIXEL_FORMAT_DEPTH_1_MM, w, h);
    if (status == ONI_STATUS_OK) status = SetMode(color, ONI_PIXEL_FORMAT_RGB888, w, h);
    if (status != ONI_STATUS_OK) continue;
    width = w;
    height = h;
    break;
  }
  library->Check(say::sensor::NoMode(name_, kFps), status);
  for (OniStreamHandle stream : {depth, color}) {
    const OniBool off = FALSE;
    library->Check(
        say::sensor::Mirroring(name_),
        library->StreamSetProperty(stream, ONI_STREAM_PROPERTY_MIRRORING, &off, sizeof off));
  }
  (void)library->DeviceEnableDepthColorSync(
      device);  // a unit without it is paired by stamps all the same
}

void OpenNiStreams::Start() {
  started_ = true;
  library->Check(say::sensor::DepthStart(name_), library->StreamStart(depth));
  library->Check(say::sensor::ColorStart(name_), library->StreamStart(color));
  // must be set after the start, because units forget it
  const int mode = ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR;
  library->Check(say::sensor::CannotRegister(name_),
                 library->DeviceSetProperty(device, ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION, &mode,
                                            sizeof mode));
}

void OpenNiStreams::Close() noexcept {
  for (OniStreamHandle stream : {depth, color}) {
    if (stream == nullptr) continue;
    if (started_) library->StreamStop(stream);
    library->StreamDestroy(stream);
  }
  if (device != nullptr) library->DeviceClose(device);
}

OpenNiSensor::OpenNiSensor(std::unique_ptr<OpenNiStreams> streams, std::shared_ptr<FrameBox> box,
                           std::shared_ptr<const void> provider,
                           const SensorDescription& description, const OpenNiOptions& options)
    : BoxedSensor(description, std::move(box)),
      provider_(std::move(provider)),
      streams_(std::move(streams)) {
  float fov_rad = 0;
  int size = sizeof fov_rad;
  if (streams_->library->StreamGetProperty(streams_->color, ONI_STREAM_PROPERTY_HORIZONTAL_FOV,
                                           &fov_rad, &size) != ONI_STATUS_OK)
    fov_rad = 0;
  SetInfo(LiveStreamInfo(options, description.serial, streams_->width, streams_->height, fov_rad));
  streams_->Start();
  this->box().Begin(kPairsToSettle);
  waiting_ = StreamWaiter::Of(*streams_->library)
                 .Add(*streams_->library, {streams_->depth, streams_->color},
                      [this](int stream, const OniFrame& frame) {
                        Accept(stream == 0 ? StreamKind::kDepth : StreamKind::kColor, frame);
                      });
}

OpenNiSensor::~OpenNiSensor() { StreamWaiter::Of(*streams_->library).Remove(waiting_); }

void OpenNiSensor::Accept(StreamKind kind, const OniFrame& frame) {
  const bool is_color = kind == StreamKind::kColor;
  box().CountGaps(kind, frame.frameIndex);
  const int row_bytes = streams_->width * (is_color ? 3 : 2);
  const bool fits = frame.width == streams_->width && frame.height == streams_->height &&
                    frame.stride >= row_bytes && frame.data != nullptr &&
                    frame.dataSize / frame.stride >= frame.height &&
                    frame.videoMode.pixelFormat ==
                        (is_color ? ONI_PIXEL_FORMAT_RGB888 : ONI_PIXEL_FORMAT_DEPTH_1_MM);
  if (!fits) {
    box().CountDiscarded();
    return;
  }
  const cv::Mat view(frame.height, frame.width, is_color ? CV_8UC3 : CV_16UC1, frame.data,
                     static_cast<std::size_t>(frame.stride));
  box().Add(kind, static_cast<std::int64_t>(frame.timestamp), view.clone());
}

void OpenNiSensor::LockExposure(bool locked) {
  const OniBool automatic = locked ? FALSE : TRUE;
  (void)Set(*streams_->library, streams_->color, ONI_STREAM_PROPERTY_AUTO_EXPOSURE, automatic);
  (void)Set(*streams_->library, streams_->color, ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE, automatic);
}

}  // namespace plumb
