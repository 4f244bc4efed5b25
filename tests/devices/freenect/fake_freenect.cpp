// SPDX-License-Identifier: Apache-2.0
#include "tests/devices/freenect/fake_freenect.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "drivers/freenect/freenect_api.hpp"

using namespace plumb::fake_freenect;

namespace {

std::atomic<int> num_alive = 0;

}  // namespace

namespace plumb::freenect {

struct Context {};
struct Device {
  FakeKinect kinect;
  void* user = nullptr;
  ImageArrived on_depth = nullptr, on_video = nullptr;
  bool depth_started = false, video_started = false, is_gone = false;
  FrameMode depth_mode, video_mode;
};

}  // namespace plumb::freenect

using namespace plumb::freenect;

namespace {

struct Waiting {
  Device* device = nullptr;
  bool is_depth = false;
  void* image = nullptr;
  std::uint32_t stamp = 0;
  bool is_done = false;
};

struct Listed {
  Attributes attributes;
  std::string serial;
};

std::mutex mutex;
std::condition_variable changed;
std::vector<FakeKinect> attached;
std::vector<std::unique_ptr<Device>> opened;
std::deque<std::shared_ptr<Waiting>> waiting;
std::map<std::pair<std::string, int>, int> flags;

FakeKinect* Find(const std::string& serial) {
  const auto found = std::ranges::find(attached, serial, &FakeKinect::serial);
  return found == attached.end() ? nullptr : &*found;
}

Device* Streaming(const std::string& serial) {
  const auto found = std::ranges::find_if(opened, [&](const auto& device) {
    return device->kinect.serial == serial && device->depth_started && device->video_started;
  });
  return found == opened.end() ? nullptr : found->get();
}

FrameMode ModeOf(int format, int bytes_per_pixel) {
  return {.resolution = kResolutionMedium,
          .format = format,
          .bytes = 640 * 480 * bytes_per_pixel,
          .width = 640,
          .height = 480,
          .rate_hz = 30,
          .is_valid = 1};
}

}  // namespace

namespace plumb::fake_freenect {

void Attach(FakeKinect kinect) {
  const std::lock_guard lock(mutex);
  attached.push_back(std::move(kinect));
}

void Detach(const std::string& serial) {
  const std::lock_guard lock(mutex);
  std::erase_if(attached, [&](const FakeKinect& kinect) { return kinect.serial == serial; });
  for (const auto& device : opened)
    if (device->kinect.serial == serial) device->is_gone = true;
  changed.notify_all();
}

bool Deliver(const std::string& serial, bool is_depth, void* image, std::uint32_t stamp) {
  std::unique_lock lock(mutex);
  Device* device = Streaming(serial);
  if (device == nullptr || device->is_gone) return false;
  const auto one = std::make_shared<Waiting>(Waiting{device, is_depth, image, stamp, false});
  waiting.push_back(one);
  changed.notify_all();
  return changed.wait_for(lock, std::chrono::seconds(10), [&] { return one->is_done; });
}

int FlagOf(const std::string& serial, int flag) {
  const std::lock_guard lock(mutex);
  const auto found = flags.find({serial, flag});
  return found == flags.end() ? -1 : found->second;
}

int NumAlive() { return num_alive; }

void Reset() {
  const std::lock_guard lock(mutex);
  attached.clear();
  flags.clear();
}

}  // namespace plumb::fake_freenect

extern "C" {

int freenect_init(Context** context, void*) {
  *context = new Context;
  ++num_alive;
  return 0;
}
int freenect_shutdown(Context* context) {
  delete context;
  --num_alive;
  return 0;
}
void freenect_set_log_level(Context*, int) {}
void freenect_select_subdevices(Context*, int) {}

int freenect_process_events_timeout(Context*, timeval* patience) {
  std::shared_ptr<Waiting> one;
  ImageArrived call = nullptr;
  {
    std::unique_lock lock(mutex);
    const auto is_gone = [] {
      return std::ranges::any_of(opened, [](const auto& device) { return device->is_gone; });
    };
    changed.wait_for(lock, std::chrono::microseconds(patience->tv_usec),
                     [&] { return !waiting.empty() || is_gone(); });
    if (is_gone()) return -1;
    if (waiting.empty()) return 0;
    one = waiting.front();
    waiting.pop_front();
    call = one->is_depth ? one->device->on_depth : one->device->on_video;
  }
  call(one->device, one->image, one->stamp);
  const std::lock_guard lock(mutex);
  one->is_done = true;
  changed.notify_all();
  return 0;
}

int freenect_num_devices(Context*) {
  const std::lock_guard lock(mutex);
  return static_cast<int>(attached.size());
}
int freenect_list_device_attributes(Context*, Attributes** list) {
  const std::lock_guard lock(mutex);
  *list = nullptr;
  for (const FakeKinect& kinect : attached) {
    auto* one = new Listed;
    one->serial = kinect.serial;
    one->attributes = {*list, one->serial.c_str()};
    *list = &one->attributes;
    ++num_alive;
  }
  return static_cast<int>(attached.size());
}
void freenect_free_device_attributes(Attributes* list) {
  while (list != nullptr) {
    Attributes* next = list->next;
    delete reinterpret_cast<Listed*>(list);  // Its first member.
    --num_alive;
    list = next;
  }
}

int freenect_open_device_by_camera_serial(Context*, Device** device, const char* serial) {
  const std::lock_guard lock(mutex);
  const FakeKinect* found = Find(serial);
  if (found == nullptr || found->busy) return -1;
  opened.push_back(std::make_unique<Device>());
  opened.back()->kinect = *found;
  *device = opened.back().get();
  ++num_alive;
  return 0;
}
int freenect_close_device(Device* device) {
  const std::lock_guard lock(mutex);
  std::erase_if(waiting, [&](const auto& one) { return one->device == device; });
  num_alive -=
      static_cast<int>(std::erase_if(opened, [&](const auto& one) { return one.get() == device; }));
  return 0;
}
void freenect_set_user(Device* device, void* user) { device->user = user; }
void* freenect_get_user(Device* device) { return device->user; }
void freenect_set_depth_callback(Device* device, ImageArrived call) { device->on_depth = call; }
void freenect_set_video_callback(Device* device, ImageArrived call) { device->on_video = call; }

FrameMode freenect_find_depth_mode(int, int format) {
  const std::lock_guard lock(mutex);
  const bool is_known =
      format == kDepthRegistered && std::ranges::all_of(attached, &FakeKinect::has_registered);
  return is_known ? ModeOf(format, 2) : FrameMode();
}
FrameMode freenect_find_video_mode(int, int format) { return ModeOf(format, 3); }
int freenect_set_depth_mode(Device* device, FrameMode mode) {
  device->depth_mode = mode;
  return mode.is_valid != 0 ? 0 : -1;
}
int freenect_set_video_mode(Device* device, FrameMode mode) {
  device->video_mode = mode;
  return mode.is_valid != 0 ? 0 : -1;
}
int freenect_start_depth(Device* device) {
  const std::lock_guard lock(mutex);
  device->depth_started = device->depth_mode.format == kDepthRegistered;
  changed.notify_all();
  return device->depth_started ? 0 : -1;
}
int freenect_start_video(Device* device) {
  const std::lock_guard lock(mutex);
  device->video_started = device->video_mode.bytes == 640 * 480 * 3;
  changed.notify_all();
  return device->video_started ? 0 : -1;
}
int freenect_stop_depth(Device* device) {
  const std::lock_guard lock(mutex);
  device->depth_started = false;
  return 0;
}
int freenect_stop_video(Device* device) {
  const std::lock_guard lock(mutex);
  device->video_started = false;
  return 0;
}
int freenect_set_flag(Device* device, int flag, int value) {
  const std::lock_guard lock(mutex);
  flags[{device->kinect.serial, flag}] = value;
  return 0;
}

}  // extern "C"
