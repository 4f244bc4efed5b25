// SPDX-License-Identifier: Apache-2.0
#include "drivers/freenect/freenect_host.hpp"

#include <algorithm>
#include <chrono>

#include "algo/base/errors.hpp"
#include "words/sdk.hpp"

namespace plumb::freenect {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kEventTime{20};
constexpr std::chrono::milliseconds kIdleTime{100};
constexpr std::chrono::milliseconds kBusTime{500};

thread_local const FreenectLibrary* running = nullptr;

}  // namespace

FreenectHost::FreenectHost(const SensorSettings& settings, OpenSensor open)
    : SdkHost("freenect"), settings_(settings), open_(std::move(open)), library_(settings.library) {
  if (library_.init(&context_, nullptr) < 0 || context_ == nullptr)
    throw DeviceError(say::sdk::NoContext(library_.file()));
  library_.set_log_level(context_, kLogFatal);
  library_.select_subdevices(context_, kSubdeviceCamera);
  num_attached_ = library_.num_devices(context_);
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

FreenectHost::~FreenectHost() {
  thread_.request_stop();
  thread_.join();
  (void)library_.shutdown(context_);
}

const FreenectLibrary& FreenectHost::Running() { return *running; }

void FreenectHost::Queue(std::function<void()> task) {
  {
    const std::lock_guard lock(tasks_mutex_);
    tasks_.push_back(std::move(task));
  }
  tasks_changed_.notify_all();
}

void FreenectHost::RunTasks() {
  for (;;) {
    std::function<void()> task;
    {
      const std::lock_guard lock(tasks_mutex_);
      if (tasks_.empty()) return;
      task = std::move(tasks_.front());
      tasks_.pop_front();
    }
    task();
  }
}

void FreenectHost::Run(const std::stop_token& stop) {
  running = &library_;
  Clock::time_point looked = Clock::now();
  while (!stop.stop_requested()) {
    RunTasks();
    if (num_open_ > 0 && !is_broken_) {
      timeval patience{.tv_sec = 0, .tv_usec = std::chrono::microseconds(kEventTime).count()};
      is_broken_ = library_.process_events_timeout(context_, &patience) < 0;
      if (is_broken_) {
        Lose([](const Watched&) { return true; });
        events().Notify();
      }
    } else {
      std::unique_lock lock(tasks_mutex_);
      (void)tasks_changed_.wait_for(lock, stop, kIdleTime, [this] { return !tasks_.empty(); });
    }
    if (Clock::now() - looked < kBusTime) continue;
    looked = Clock::now();
    LookAtBus();
  }
}

/// Serials are asked for only when the number has changed, because that opens each Kinect.
void FreenectHost::LookAtBus() {
  const int count = library_.num_devices(context_);
  if (count == num_attached_) return;
  num_attached_ = count;
  std::vector<std::string> serials;
  try {
    serials = Serials();
  } catch (const DeviceError&) {
    // The next listing of sensors reports the error; an open sensor reports its own removal.
    return events().Notify();
  }
  Lose([&](const Watched& watched) {
    return std::ranges::find(serials, watched.serial) == serials.end();
  });
  events().Notify();
}

std::vector<std::string> FreenectHost::Serials() const {
  Attributes* first = nullptr;
  if (library_.list_device_attributes(context_, &first) < 0)
    throw DeviceError(say::sdk::NoList(FreenectTitle().name));
  std::vector<std::string> serials;
  for (const Attributes* one = first; one != nullptr; one = one->next) {
    const std::string serial = SdkText(one->camera_serial);
    if (!serial.empty()) serials.push_back(serial);
  }
  if (first != nullptr) library_.free_device_attributes(first);
  return serials;
}

std::vector<SdkAttached> FreenectHost::Attached() {
  std::vector<SdkAttached> attached;
  for (const std::string& serial : Do([this] { return Serials(); }))
    attached.push_back({.unit = {.name = "Kinect",
                                 .serial = serial,
                                 .needs_usb3 = false,
                                 .depth_sensor = DepthSensor::kStructuredLight},
                        .device = nullptr});
  return attached;
}

std::unique_ptr<LiveSensor> FreenectHost::Open(const std::shared_ptr<SdkHost>& self,
                                               SdkOpening opening) {
  return open_(std::static_pointer_cast<FreenectHost>(self), std::move(opening), settings_);
}

}  // namespace plumb::freenect
