// SPDX-License-Identifier: Apache-2.0
#include "daemon/sweep/second_sensor.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/sweep/explain.hpp"
#include "drivers/live/sensor_driver.hpp"

namespace plumb {
namespace {

constexpr std::chrono::seconds kOpenAgain{1};

}  // namespace

void SecondSensor::Tend(SensorProvider* provider, const std::shared_ptr<LiveFeed>& feed) {
  if (serial_.empty()) return;
  if (feed != feed_ || has_ended_) {
    Close();
    retry_at_ = {};
  }
  feed_ = feed;
  const auto now = std::chrono::steady_clock::now();
  if (!feed_ || sensor_ || provider == nullptr || now < retry_at_) return;
  retry_at_ = now + kOpenAgain;
  try {
    const auto attached = provider->List();
    if (std::ranges::find(attached, serial_, &SensorDescription::serial) == attached.end()) return;
    sensor_ = OpenSensor(*provider, serial_);
    sensor_->LockExposure(true);
    Log(LogLevel::kInfo, "the second sensor is open", {{"SERIAL", serial_}});
  } catch (const std::exception& error) {
    sensor_.reset();
    Log(LogLevel::kWarning,
        fmt::format("the second sensor does not work: {}", Explain(error).English()),
        {{"SERIAL", serial_}});
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    info_ = sensor_->info();
    info_of_ = feed_;
  }
  opened_.notify_all();
  thread_ = std::jthread([this, sensor = sensor_, to = feed_](const std::stop_token& stop) {
    Read(stop, *sensor, *to);
  });
}

void SecondSensor::Read(const std::stop_token& stop, LiveSensor& sensor, LiveFeed& feed) {
  while (!stop.stop_requested()) {
    try {
      std::optional<Frame> frame = sensor.Next();
      if (!frame) break;
      feed.Push(std::move(*frame), 1);
    } catch (const ProcessStalled&) {  // that says nothing about the sensor
    } catch (const std::exception& error) {
      Log(LogLevel::kWarning,
          fmt::format("the second sensor has ended: {}", Explain(error).English()),
          {{"SERIAL", serial_}});
      break;
    }
  }
  has_ended_ = true;
}

void SecondSensor::Close() {
  if (sensor_) {
    thread_.request_stop();
    sensor_->Interrupt();
    thread_ = {};
    sensor_.reset();
  }
  has_ended_ = false;
}

std::optional<StreamInfo> SecondSensor::AwaitInfo(const std::shared_ptr<LiveFeed>& feed,
                                                  std::chrono::milliseconds patience,
                                                  const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  const bool is_open =
      opened_.wait_for(lock, stop, patience, [&] { return info_ && info_of_.lock() == feed; });
  return is_open ? info_ : std::nullopt;
}

}  // namespace plumb
