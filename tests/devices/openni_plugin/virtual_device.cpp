// SPDX-License-Identifier: Apache-2.0
#include "tests/devices/openni_plugin/virtual_device.hpp"

#include <algorithm>
#include <utility>

namespace plumb::simulated {
namespace {

constexpr int kUnregisteredShift_px = 12;

}  // namespace

VirtualDevice::VirtualDevice(std::shared_ptr<Unit> unit, const std::shared_ptr<const Stage>& stage)
    : unit_(std::move(unit)), shape_(stage->shape()) {
  for (const bool depth : {true, false}) {
    modes_[depth ? 0 : 1] = VirtualStream::Mode(depth, shape_);
    sensors_[depth ? 0 : 1] = {depth ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR, 1,
                               &modes_[depth ? 0 : 1]};
  }
  player_ = std::make_unique<SweepPlayer>(
      unit_, stage, [this] { return StreamsRun(); },
      [this](const PlayedPair& pair) { Emit(pair); });
}

OniStatus VirtualDevice::getSensorInfoList(OniSensorInfo** sensors, int* count) {
  *sensors = sensors_;
  *count = 2;
  return ONI_STATUS_OK;
}

oni::driver::StreamBase* VirtualDevice::createStream(OniSensorType type) {
  if (type != ONI_SENSOR_DEPTH && type != ONI_SENSOR_COLOR) return nullptr;
  const std::lock_guard lock(mutex_);
  streams_.push_back(new VirtualStream(type == ONI_SENSOR_DEPTH, shape_));
  registration_ = ONI_IMAGE_REGISTRATION_OFF;
  return streams_.back();
}

void VirtualDevice::destroyStream(oni::driver::StreamBase* stream) {
  {
    const std::lock_guard lock(mutex_);
    std::erase(streams_, stream);
  }
  delete stream;
}

OniBool VirtualDevice::isPropertySupported(int id) {
  return id == ONI_DEVICE_PROPERTY_SERIAL_NUMBER || id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION ||
         id == ONI_DEVICE_PROPERTY_DRIVER_VERSION;
}

OniStatus VirtualDevice::getProperty(int id, void* data, int* size) {
  switch (id) {
    case ONI_DEVICE_PROPERTY_DRIVER_VERSION:
      return Answer(OniVersion{1, 0, 0, 0}, data, size);
    case ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION:
      return Answer(registration_.load(), data, size);
    case ONI_DEVICE_PROPERTY_SERIAL_NUMBER: {
      const int length = static_cast<int>(unit_->serial.size()) + 1;
      if (*size < length) return ONI_STATUS_BAD_PARAMETER;
      std::memcpy(data, unit_->serial.c_str(), static_cast<std::size_t>(length));
      *size = length;
      return ONI_STATUS_OK;
    }
    default:
      return ONI_STATUS_NOT_SUPPORTED;
  }
}

OniStatus VirtualDevice::setProperty(int id, const void* data, int size) {
  if (id != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) return ONI_STATUS_NOT_SUPPORTED;
  int mode = 0;
  if (Accept(data, size, mode) != ONI_STATUS_OK) return ONI_STATUS_BAD_PARAMETER;
  if (StreamsRun()) registration_ = mode;  // before that, real units answer "ok" and forget it
  return ONI_STATUS_OK;
}

bool VirtualDevice::StreamsRun() {
  const std::lock_guard lock(mutex_);
  return std::count_if(streams_.begin(), streams_.end(),
                       [](const VirtualStream* stream) { return stream->running(); }) >= 2;
}

void VirtualDevice::Emit(const PlayedPair& pair) {
  const std::lock_guard lock(mutex_);
  for (VirtualStream* stream : streams_) {
    const bool depth = stream->is_depth();
    if (pair.depth_only && !depth) continue;
    VirtualStream::Picture picture;
    if (depth)
      picture.bytes = {reinterpret_cast<const std::uint8_t*>(pair.depth_mm.data()),
                       pair.depth_mm.size_bytes()};
    else
      picture.bytes = pair.rgb;
    picture.frame_index = pair.frame_index;
    picture.stamp_us =
        static_cast<std::uint64_t>(depth ? pair.stamps.depth_us : pair.stamps.color_us);
    picture.shift =
        depth && registration_ != ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR ? kUnregisteredShift_px : 0;
    picture.small = pair.small;
    stream->Emit(picture);
  }
}

}  // namespace plumb::simulated
