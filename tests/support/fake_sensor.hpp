// SPDX-License-Identifier: Apache-2.0
// A sensor and its provider that do what a test says: frames of a wall, unplugging, stalls, failing
// drivers.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "algo/base/errors.hpp"
#include "drivers/sensor.hpp"

namespace plumb::testing {

/// What the test changes and the fakes obey. Thread-safe.
class FakeBus {
 public:
  void Plug(const std::string& serial) {
    Change([&] { attached_.push_back(serial); });
  }
  /// Without a word to the listener.
  void PlugUnreported(const std::string& serial) {
    const std::lock_guard lock(mutex_);
    attached_.push_back(serial);
  }
  void Unplug() {
    Change([&] { attached_.clear(); });
  }
  /// The next Next() throws DeviceError.
  void FailOnce(const std::string& why) {
    Change([&] { failure_ = why; });
  }
  /// The next Next() throws ProcessStalled.
  void StallOnce(const std::string& why) {
    Change([&] { stall_ = why; });
  }
  void RefuseToOpen(const std::string& why) {
    Change([&] { refusal_ = why; });
  }
  /// Stated by the sensors that are opened from now on.
  void StateNoise(const DepthNoise& noise) {
    Change([&] { noise_ = noise; });
  }
  /// One frame comes; frame numbers count over all sensors.
  void GiveFrame() {
    Change([&] { ++given_; });
  }

  [[nodiscard]] int opened() const {
    const std::lock_guard lock(mutex_);
    return opened_;
  }
  [[nodiscard]] int flushed() const {
    const std::lock_guard lock(mutex_);
    return flushed_;
  }
  [[nodiscard]] bool exposure_locked() const {
    const std::lock_guard lock(mutex_);
    return locked_;
  }
  [[nodiscard]] int taken() const {
    const std::lock_guard lock(mutex_);
    return taken_;
  }

  static StreamInfo Info() {
    StreamInfo info;
    info.intrinsics = {.width = 160, .height = 120, .fx = 130, .fy = 130, .cx = 79.5, .cy = 59.5};
    return info;
  }
  static Frame Wall(std::int64_t index) {
    Frame frame;
    frame.index = index;
    frame.color_time_s = frame.depth_time_s = static_cast<double>(index) / 30;
    frame.color_rgb = cv::Mat(120, 160, CV_8UC3, cv::Scalar::all(128));
    frame.depth_m = cv::Mat(120, 160, CV_32FC1, cv::Scalar(1.0));
    return frame;
  }

 private:
  friend class FakeSensor;
  friend class FakeProvider;
  void Change(const std::function<void()>& change) {
    std::function<void()> listener;
    {
      const std::lock_guard lock(mutex_);
      change();
      listener = listener_;
    }
    changed_.notify_all();
    if (listener) listener();
  }

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> attached_;
  std::string failure_, stall_, refusal_;
  std::function<void()> listener_;
  DepthNoise noise_;
  int given_ = 0, taken_ = 0, opened_ = 0, flushed_ = 0;
  bool locked_ = false;
};

class FakeSensor : public LiveSensor {
 public:
  FakeSensor(FakeBus& bus, const std::string& serial)
      : bus_(bus), description_{.uri = "fake/" + serial, .serial = serial, .name = "fake"} {
    info_.depth_noise = bus.noise_;  // its provider holds the lock
  }
  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] const SensorDescription& description() const override { return description_; }
  [[nodiscard]] SensorStatistics statistics() const override { return {}; }
  void Interrupt() noexcept override {
    const std::lock_guard lock(bus_.mutex_);
    interrupted_ = true;
    bus_.changed_.notify_all();
  }
  void Flush() noexcept override {
    const std::lock_guard lock(bus_.mutex_);
    ++bus_.flushed_;
  }
  void LockExposure(bool locked) override {
    const std::lock_guard lock(bus_.mutex_);
    bus_.locked_ = locked;
  }
  std::optional<Frame> Next() override {
    std::unique_lock lock(bus_.mutex_);
    const auto is_gone = [&] {
      return std::find(bus_.attached_.begin(), bus_.attached_.end(), description_.serial) ==
             bus_.attached_.end();
    };
    bus_.changed_.wait(lock, [&] {
      return interrupted_ || !bus_.failure_.empty() || !bus_.stall_.empty() || is_gone() ||
             bus_.given_ > bus_.taken_;
    });
    if (interrupted_) return std::nullopt;
    if (is_gone()) throw DeviceLost("gone");
    if (!bus_.failure_.empty()) throw DeviceError(std::exchange(bus_.failure_, {}));
    if (!bus_.stall_.empty()) throw ProcessStalled(std::exchange(bus_.stall_, {}));
    return FakeBus::Wall(bus_.taken_++);
  }

 private:
  FakeBus& bus_;
  SensorDescription description_;
  StreamInfo info_ = FakeBus::Info();
  bool interrupted_ = false;
};

class FakeProvider : public SensorProvider {
 public:
  explicit FakeProvider(FakeBus& bus) : bus_(bus) {}
  ~FakeProvider() override { SetListener({}); }
  [[nodiscard]] std::vector<SensorDescription> List() override {
    const std::lock_guard lock(bus_.mutex_);
    std::vector<SensorDescription> list;
    for (const std::string& serial : bus_.attached_)
      list.push_back({.uri = "fake/" + serial, .serial = serial, .name = "fake"});
    return list;
  }
  void SetListener(std::function<void()> changed) override {
    const std::lock_guard lock(bus_.mutex_);
    bus_.listener_ = std::move(changed);
  }
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::string& serial) override {
    const std::lock_guard lock(bus_.mutex_);
    if (!bus_.refusal_.empty()) throw DeviceError(std::exchange(bus_.refusal_, {}));
    ++bus_.opened_;
    return std::make_unique<FakeSensor>(bus_, serial);
  }

 private:
  FakeBus& bus_;
};

}  // namespace plumb::testing
