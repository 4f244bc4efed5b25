#include "drivers/virtual/plugin/virtual_device.hpp"

#include <algorithm>
#include <stdexcept>

namespace plumb::simulated {
namespace {

constexpr int kUnregisteredShift_px = 12;
constexpr int kTicksBeforeSweep = 2;
constexpr std::chrono::milliseconds kIdle{5};
constexpr std::chrono::milliseconds kBetweenDoubles{8};

}  // namespace

VirtualDevice::VirtualDevice(std::shared_ptr<Unit> unit, std::shared_ptr<const Stage> stage)
    : unit_(std::move(unit)),
      stage_(std::move(stage)),
      rgb_(stage_->shape().color_bytes()),
      depth_mm_(stage_->shape().depth_bytes() / 2) {
  for (const bool depth : {true, false}) {
    modes_[depth ? 0 : 1] = VirtualStream::Mode(depth, stage_->shape());
    sensors_[depth ? 0 : 1] = {depth ? ONI_SENSOR_DEPTH : ONI_SENSOR_COLOR, 1,
                               &modes_[depth ? 0 : 1]};
  }
  view_.epoch = ~std::uint64_t{0};
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

VirtualDevice::~VirtualDevice() {
  thread_.request_stop();
  wake_.notify_all();
}

OniStatus VirtualDevice::getSensorInfoList(OniSensorInfo** sensors, int* count) {
  *sensors = sensors_;
  *count = 2;
  return ONI_STATUS_OK;
}

oni::driver::StreamBase* VirtualDevice::createStream(OniSensorType type) {
  if (type != ONI_SENSOR_DEPTH && type != ONI_SENSOR_COLOR) return nullptr;
  const std::lock_guard lock(mutex_);
  streams_.push_back(new VirtualStream(type == ONI_SENSOR_DEPTH, stage_->shape()));
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
  if (StreamsRun()) registration_ = mode;  // before, real units answer "ok" and forget it
  return ONI_STATUS_OK;
}

bool VirtualDevice::StreamsRun() {
  const std::lock_guard lock(mutex_);
  return std::count_if(streams_.begin(), streams_.end(),
                       [](const VirtualStream* stream) { return stream->running(); }) >= 2;
}

void VirtualDevice::SleepUntil(Clock::time_point time, const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  wake_.wait_until(lock, stop, time, [] { return false; });
}

void VirtualDevice::Run(const std::stop_token& stop) {
  due_ = Clock::now();
  while (!stop.stop_requested()) {
    if (!StreamsRun()) {
      SleepUntil(Clock::now() + kIdle, stop);
      due_ = Clock::now();
      continue;
    }
    try {
      Tick(stop);
    } catch (const std::exception&) {
      unit_->failed = true;  // the cache cannot be read any more: the unit has failed, and its user
                             // sees a stall
    }
    const std::int64_t period_us = stage_->shape().period_us;
    device_us_ += period_us;
    if (view_.speed > 0) {
      const std::chrono::microseconds period(
          static_cast<std::int64_t>(static_cast<double>(period_us) / view_.speed));
      // Time lost is made up slowly: OpenNI2 keeps only the newest image of a stream, so a burst
      // would be lost in part.
      due_ = std::max(due_ + period, Clock::now() + period / 2);
      SleepUntil(due_, stop);
    } else {
      due_ = Clock::now();
    }
  }
}

void VirtualDevice::Tick(const std::stop_token& stop) {
  if (Stage::View now = stage_->Now(); now.epoch != view_.epoch) {
    view_ = std::move(now);
    next_ = 0;
    loaded_frame_ = -1;
    wait_ticks_ = view_.motion == Stage::Motion::kStill ? 0 : kTicksBeforeSweep;
    unit_->position = -1;
  } else {
    view_.speed = now.speed;
  }
  if (wait_ticks_ > 0) {
    --wait_ticks_;
    return;
  }
  const std::uint32_t last = view_.scene->shape().num_frames - 1;
  const bool in_sweep = view_.motion != Stage::Motion::kStill && next_ <= last;
  if (!in_sweep && view_.motion == Stage::Motion::kSweepOnce) return;
  Load(std::min(next_, last));
  Shown shown;
  if (in_sweep) {
    if (next_ == 0)
      sweep_begin_us_ =
          view_.origin_us >= 0 ? view_.origin_us : device_us_ - loaded_stamps_.color_us;
    shown.stamps = {sweep_begin_us_ + loaded_stamps_.color_us,
                    sweep_begin_us_ + loaded_stamps_.depth_us};
    ++next_;
  } else {
    shown.stamps = {device_us_, device_us_ + loaded_stamps_.depth_us - loaded_stamps_.color_us};
  }
  if (unit_->silent()) return;
  shown.frame_index = ++frame_index_;
  if (unit_->glitch == Glitch::kLate && unit_->glitches_left > 0)
    SleepUntil(Clock::now() + std::chrono::microseconds(3 * view_.scene->shape().period_us), stop);
  Give(shown, stop);
  unit_->position = static_cast<int>(loaded_frame_);
}

void VirtualDevice::Load(std::uint32_t frame) {
  if (loaded_frame_ == frame) return;
  loaded_stamps_ = view_.scene->Read(frame, rgb_, depth_mm_);
  loaded_frame_ = frame;
}

void VirtualDevice::Give(const Shown& shown, const std::stop_token& stop) {
  const Glitch glitch = unit_->glitches_left > 0 ? unit_->glitch.load() : Glitch::kNone;
  if (glitch != Glitch::kNone) --unit_->glitches_left;
  EmitBoth(shown, glitch == Glitch::kSize, glitch == Glitch::kLone);
  if (glitch == Glitch::kDouble || glitch == Glitch::kOld)
    SleepUntil(Clock::now() + kBetweenDoubles, stop);
  if (glitch == Glitch::kDouble) EmitBoth(shown, false, false);
  if (glitch == Glitch::kOld) {
    Shown old = shown;
    old.stamps.color_us -= 3 * stage_->shape().period_us;
    old.stamps.depth_us -= 3 * stage_->shape().period_us;
    EmitBoth(old, false, false);
  }
}

void VirtualDevice::EmitBoth(const Shown& shown, bool small, bool depth_only) {
  const std::lock_guard lock(mutex_);
  for (VirtualStream* stream : streams_) {
    const bool depth = stream->is_depth();
    if (depth_only && !depth) continue;
    VirtualStream::Picture picture;
    if (depth)
      picture.bytes = {reinterpret_cast<const std::uint8_t*>(depth_mm_.data()),
                       depth_mm_.size() * 2};
    else
      picture.bytes = rgb_;
    picture.frame_index = shown.frame_index;
    picture.stamp_us =
        static_cast<std::uint64_t>(depth ? shown.stamps.depth_us : shown.stamps.color_us);
    picture.shift =
        depth && registration_ != ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR ? kUnregisteredShift_px : 0;
    picture.small = small;
    stream->Emit(picture);
  }
}

}  // namespace plumb::simulated
