// SPDX-License-Identifier: Apache-2.0
#include "tests/devices/orbbec/fake_orbbec.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

using namespace plumb::fake_orbbec;

namespace {

std::atomic<int> num_alive = 0;

/// Counts the objects that the library has given out.
struct Counted {
  Counted() { ++num_alive; }
  ~Counted() { --num_alive; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
};

struct Started {
  plumb::orbbec::FrameArrived call = nullptr;
  void* user = nullptr;
};

/// A camera in its port.
struct Plugged {
  FakeCamera camera;
  bool is_open = false;
  std::map<int, Started> started;  ///< By type of sensor.
  std::map<int, int> properties;
  int num_delivering = 0;
};

}  // namespace

namespace plumb::orbbec {

struct Error : Counted {
  std::string message;
};
struct Context : Counted {};
struct DeviceList : Counted {
  std::vector<std::shared_ptr<Plugged>> cameras;
};
struct Device : Counted {
  std::shared_ptr<Plugged> camera;
};
struct DeviceInfo : Counted {
  FakeCamera camera;
};
struct Sensor : Counted {
  std::shared_ptr<Plugged> camera;
  int type = 0;
};
struct ProfileList : Counted {
  std::shared_ptr<Plugged> camera;
  int type = 0;
  [[nodiscard]] const std::vector<FakeMode>& modes() const {
    return type == kSensorDepth ? camera->camera.depth_modes : camera->camera.color_modes;
  }
};
struct Profile : Counted {
  std::shared_ptr<Plugged> camera;
  int type = 0;
  FakeMode mode;
};
struct ObFrame : Counted {
  FakeImage image;
};

}  // namespace plumb::orbbec

using namespace plumb::orbbec;

namespace {

std::mutex mutex;
std::condition_variable changed;
std::vector<std::shared_ptr<Plugged>> plugged;
DevicesChanged listener = nullptr;
void* listener_user = nullptr;
int version = 20807;

std::shared_ptr<Plugged> Find(const std::string& serial) {
  const auto found =
      std::ranges::find(plugged, serial, [](const auto& p) { return p->camera.serial; });
  return found == plugged.end() ? nullptr : *found;
}

void Fail(Error** error, const std::string& why) {
  *error = new Error;
  (*error)->message = why;
}

/// The library makes both lists, and who is called deletes them.
void Tell(const std::vector<std::shared_ptr<Plugged>>& removed,
          const std::vector<std::shared_ptr<Plugged>>& added) {
  DevicesChanged call = nullptr;
  void* user = nullptr;
  {
    const std::lock_guard lock(mutex);
    call = listener;
    user = listener_user;
  }
  if (call == nullptr) return;
  auto* first = new DeviceList;
  auto* second = new DeviceList;
  first->cameras = removed;
  second->cameras = added;
  call(first, second, user);
}

}  // namespace

namespace plumb::fake_orbbec {

void Attach(FakeCamera camera) {
  auto added = std::make_shared<Plugged>();
  added->camera = std::move(camera);
  {
    const std::lock_guard lock(mutex);
    plugged.push_back(added);
  }
  Tell({}, {added});
}

void Detach(const std::string& serial) {
  std::shared_ptr<Plugged> removed;
  {
    const std::lock_guard lock(mutex);
    removed = Find(serial);
    if (!removed) return;
    std::erase(plugged, removed);
  }
  Tell({removed}, {});
}

bool Deliver(const std::string& serial, const FakeImage& image) {
  std::shared_ptr<Plugged> camera;
  Started to;
  {
    const std::lock_guard lock(mutex);
    camera = Find(serial);
    const int type = image.is_depth ? kSensorDepth : kSensorColor;
    if (!camera || !camera->started.contains(type)) return false;
    to = camera->started[type];
    ++camera->num_delivering;
  }
  auto* frame = new ObFrame;
  frame->image = image;
  to.call(frame, to.user);
  const std::lock_guard lock(mutex);
  --camera->num_delivering;
  changed.notify_all();
  return true;
}

int PropertyOf(const std::string& serial, int property) {
  const std::lock_guard lock(mutex);
  const auto camera = Find(serial);
  if (!camera) return -1;
  const auto found = camera->properties.find(property);
  return found == camera->properties.end() ? -1 : found->second;
}

void SetVersion(int wanted) { version = wanted; }
int NumAlive() { return num_alive; }

void Reset() {
  const std::lock_guard lock(mutex);
  plugged.clear();
  version = 20807;
}

}  // namespace plumb::fake_orbbec

extern "C" {

int ob_get_version() { return version; }
const char* ob_error_get_message(const Error* error) { return error->message.c_str(); }
void ob_delete_error(Error** error) {
  delete *error;
  *error = nullptr;
}
void ob_set_logger_to_file(int, const char*, Error**) {}
void ob_set_logger_to_console(int, Error**) {}
void ob_set_extensions_directory(const char*, Error**) {}

Context* ob_create_context(Error**) { return new Context; }
void ob_delete_context(Context* context, Error**) {
  {
    const std::lock_guard lock(mutex);
    listener = nullptr;
  }
  delete context;
}
void ob_set_device_changed_callback(Context*, DevicesChanged call, void* user, Error**) {
  const std::lock_guard lock(mutex);
  listener = call;
  listener_user = user;
}

DeviceList* ob_query_device_list(Context*, Error**) {
  auto* list = new DeviceList;
  const std::lock_guard lock(mutex);
  list->cameras = plugged;
  return list;
}
void ob_delete_device_list(DeviceList* list, Error**) { delete list; }
std::uint32_t ob_device_list_get_count(const DeviceList* list, Error**) {
  return static_cast<std::uint32_t>(list->cameras.size());
}
const char* ob_device_list_get_device_serial_number(const DeviceList* list, std::uint32_t index,
                                                    Error**) {
  return list->cameras.at(index)->camera.serial.c_str();
}
const char* ob_device_list_get_device_name(const DeviceList* list, std::uint32_t index, Error**) {
  return list->cameras.at(index)->camera.name.c_str();
}
const char* ob_device_list_get_device_connection_type(const DeviceList* list, std::uint32_t index,
                                                      Error**) {
  return list->cameras.at(index)->camera.port.c_str();
}
Device* ob_device_list_get_device(const DeviceList* list, std::uint32_t index, Error** error) {
  if (index >= list->cameras.size()) {
    Fail(error, "index out of range");
    return nullptr;
  }
  const std::lock_guard lock(mutex);
  const auto& camera = list->cameras[index];
  if (std::exchange(camera->is_open, true)) {
    Fail(error, "device has been acquired already");
    return nullptr;
  }
  auto* device = new Device;
  device->camera = camera;
  return device;
}
void ob_delete_device(Device* device, Error**) {
  {
    const std::lock_guard lock(mutex);
    device->camera->is_open = false;
  }
  delete device;
}
DeviceInfo* ob_device_get_device_info(const Device* device, Error**) {
  auto* info = new DeviceInfo;
  info->camera = device->camera->camera;
  return info;
}
void ob_delete_device_info(DeviceInfo* info, Error**) { delete info; }
const char* ob_device_info_get_firmware_version(const DeviceInfo* info, Error**) {
  return info->camera.firmware.c_str();
}
int ob_device_info_get_device_type(const DeviceInfo* info, Error**) { return info->camera.type; }

bool ob_device_is_property_supported(const Device*, int property, int permission, Error**) {
  return permission == kPermissionWrite &&
         (property == kPropertyLaser || property == kPropertyColorAutoExposure ||
          property == kPropertyColorExposure || property == kPropertyColorAutoWhiteBalance);
}
void ob_device_set_bool_property(Device* device, int property, bool value, Error**) {
  const std::lock_guard lock(mutex);
  device->camera->properties[property] = value ? 1 : 0;
}
void ob_device_set_int_property(Device* device, int property, std::int32_t value, Error** error) {
  const ObRange& range = device->camera->camera.exposure;
  if (value < range.least || value > range.most) return Fail(error, "out of range");
  const std::lock_guard lock(mutex);
  device->camera->properties[property] = value;
}
ObRange ob_device_get_int_property_range(Device* device, int, Error**) {
  return device->camera->camera.exposure;
}

Sensor* ob_device_get_sensor(Device* device, int type, Error**) {
  auto* sensor = new Sensor;
  sensor->camera = device->camera;
  sensor->type = type;
  return sensor;
}
void ob_delete_sensor(Sensor* sensor, Error**) { delete sensor; }
ProfileList* ob_sensor_get_stream_profile_list(const Sensor* sensor, Error**) {
  auto* list = new ProfileList;
  list->camera = sensor->camera;
  list->type = sensor->type;
  return list;
}
std::uint32_t ob_stream_profile_list_get_count(const ProfileList* list, Error**) {
  return static_cast<std::uint32_t>(list->modes().size());
}
Profile* ob_stream_profile_list_get_profile(const ProfileList* list, int index, Error**) {
  auto* profile = new Profile;
  profile->camera = list->camera;
  profile->type = list->type;
  profile->mode = list->modes().at(static_cast<std::size_t>(index));
  return profile;
}
void ob_delete_stream_profile_list(const ProfileList* list, Error**) { delete list; }
void ob_delete_stream_profile(const Profile* profile, Error**) { delete profile; }
int ob_stream_profile_get_format(const Profile* profile, Error**) { return profile->mode.format; }
std::uint32_t ob_video_stream_profile_get_fps(const Profile* profile, Error**) {
  return profile->mode.rate_hz;
}
std::uint32_t ob_video_stream_profile_get_width(const Profile* profile, Error**) {
  return static_cast<std::uint32_t>(profile->mode.camera.width);
}
std::uint32_t ob_video_stream_profile_get_height(const Profile* profile, Error**) {
  return static_cast<std::uint32_t>(profile->mode.camera.height);
}
ObIntrinsics ob_video_stream_profile_get_intrinsic(const Profile* profile, Error**) {
  return profile->mode.camera;
}
ObDistortion ob_video_stream_profile_get_distortion(const Profile* profile, Error**) {
  return profile->mode.lens;
}
ObExtrinsics ob_stream_profile_get_extrinsic_to(const Profile* from, Profile* to, Error** error) {
  if (from->type != kSensorDepth || to->type != kSensorColor)
    Fail(error, "only depth to colour is known");
  return from->camera->camera.depth_to_color;
}

void ob_sensor_start(Sensor* sensor, const Profile* profile, FrameArrived call, void* user,
                     Error** error) {
  if (sensor->camera->camera.busy) return Fail(error, "device or resource busy");
  if (profile->type != sensor->type) return Fail(error, "profile of another sensor");
  const std::lock_guard lock(mutex);
  sensor->camera->started[sensor->type] = {call, user};
}
void ob_sensor_stop(Sensor* sensor, Error**) {
  std::unique_lock lock(mutex);
  sensor->camera->started.erase(sensor->type);
  changed.wait(lock, [&] { return sensor->camera->num_delivering == 0; });
}

int ob_frame_get_type(const ObFrame* frame, Error**) {
  return frame->image.is_depth ? kFrameDepth : kFrameColor;
}
int ob_frame_get_format(const ObFrame* frame, Error**) { return frame->image.format; }
std::uint64_t ob_frame_get_index(const ObFrame* frame, Error**) { return frame->image.number; }
std::uint64_t ob_frame_get_timestamp_us(const ObFrame* frame, Error**) {
  return frame->image.stamp_us;
}
std::uint8_t* ob_frame_get_data(const ObFrame* frame, Error**) {
  return static_cast<std::uint8_t*>(frame->image.data);
}
std::uint32_t ob_frame_get_data_size(const ObFrame* frame, Error**) { return frame->image.bytes; }
std::uint32_t ob_video_frame_get_width(const ObFrame* frame, Error**) { return frame->image.width; }
std::uint32_t ob_video_frame_get_height(const ObFrame* frame, Error**) {
  return frame->image.height;
}
float ob_depth_frame_get_value_scale(const ObFrame* frame, Error**) {
  return frame->image.scale_mm;
}
void ob_delete_frame(const ObFrame* frame, Error**) { delete frame; }

}  // extern "C"
