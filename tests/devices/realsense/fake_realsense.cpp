// SPDX-License-Identifier: Apache-2.0
#include "tests/devices/realsense/fake_realsense.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>

using namespace plumb::fake_realsense;

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
  plumb::realsense::FrameArrived call = nullptr;
  void* user = nullptr;
};

/// A camera in its port.
struct Plugged {
  FakeUnit unit;
  bool is_gone = false;
  std::map<int, Started> started;                ///< By stream.
  std::map<std::pair<int, int>, float> options;  ///< By sensor and option.
  int num_delivering = 0;

  [[nodiscard]] const std::vector<FakeMode>& modes(int sensor) const {
    return sensor == 0 ? unit.depth_modes : unit.color_modes;
  }
};

}  // namespace

namespace plumb::realsense {

struct Error {
  std::string message;
};
struct Context : Counted {
  int version = 0;
};
struct DeviceList : Counted {
  std::vector<std::shared_ptr<Plugged>> units;
};
struct Device : Counted {
  std::shared_ptr<Plugged> unit;
};
struct SensorList : Counted {
  std::shared_ptr<Plugged> unit;
};
struct Profile {
  const Plugged* unit = nullptr;
  int sensor = 0;
  FakeMode mode;
};
struct Sensor : Counted {
  std::shared_ptr<Plugged> unit;
  int index = 0;
  std::vector<int> opened;  ///< Streams.
};
struct ProfileList : Counted {
  std::vector<Profile> profiles;
};
struct RsFrame : Counted {
  FakeImage image;
  Profile profile;
};

}  // namespace plumb::realsense

using namespace plumb::realsense;

namespace {

std::mutex mutex;
std::condition_variable changed;
std::vector<std::shared_ptr<Plugged>> plugged;
DevicesChanged listener = nullptr;
void* listener_user = nullptr;
int api_version = 25605;

std::shared_ptr<Plugged> Find(const std::string& serial) {
  const auto found =
      std::ranges::find(plugged, serial, [](const auto& p) { return p->unit.serial; });
  return found == plugged.end() ? nullptr : *found;
}

void Fail(Error** error, const std::string& why) {
  if (error != nullptr) *error = new Error{why};
}

template <typename Object>
Object* With(std::shared_ptr<Plugged> unit) {
  auto* object = new Object;
  object->unit = std::move(unit);
  return object;
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
  first->units = removed;
  second->units = added;
  call(first, second, user);
}

}  // namespace

namespace plumb::fake_realsense {

void Attach(FakeUnit unit) {
  auto added = std::make_shared<Plugged>();
  added->unit = std::move(unit);
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
    removed->is_gone = true;
    std::erase(plugged, removed);
  }
  Tell({removed}, {});
}

bool Deliver(const std::string& serial, const FakeImage& image) {
  std::shared_ptr<Plugged> unit;
  Started to;
  auto* frame = new RsFrame;
  {
    const std::lock_guard lock(mutex);
    unit = Find(serial);
    if (!unit || !unit->started.contains(image.stream)) {
      delete frame;
      return false;
    }
    to = unit->started[image.stream];
    ++unit->num_delivering;
    frame->image = image;
    frame->profile.unit = unit.get();
    frame->profile.mode.stream = image.stream;
    frame->profile.mode.format = image.format;
  }
  to.call(frame, to.user);
  const std::lock_guard lock(mutex);
  --unit->num_delivering;
  changed.notify_all();
  return true;
}

bool AwaitStreaming(const std::string& serial, std::chrono::seconds patience) {
  std::unique_lock lock(mutex);
  return changed.wait_for(lock, patience, [&] {
    const auto unit = Find(serial);
    return unit && unit->started.size() == 2;
  });
}

float OptionOf(const std::string& serial, int stream, int option) {
  const std::lock_guard lock(mutex);
  const auto unit = Find(serial);
  if (!unit) return -1;
  const int sensor = stream == kStreamColor && !unit->unit.color_modes.empty() ? 1 : 0;
  const auto found = unit->options.find({sensor, option});
  return found == unit->options.end() ? -1 : found->second;
}

void SetVersion(int version) { api_version = version; }
int NumAlive() { return num_alive; }

void Reset() {
  const std::lock_guard lock(mutex);
  for (const auto& unit : plugged) unit->is_gone = true;
  plugged.clear();
  api_version = 25605;
}

}  // namespace plumb::fake_realsense

extern "C" {

int rs2_get_api_version(Error**) { return api_version; }
const char* rs2_get_error_message(const Error* error) { return error->message.c_str(); }
void rs2_free_error(Error* error) { delete error; }

Context* rs2_create_context(int version, Error** error) {
  if (version != api_version) {
    Fail(error, "API version mismatch");
    return nullptr;
  }
  return new Context;
}
void rs2_delete_context(Context* context) {
  {
    const std::lock_guard lock(mutex);
    listener = nullptr;
  }
  delete context;
}
void rs2_set_devices_changed_callback(const Context*, DevicesChanged call, void* user, Error**) {
  const std::lock_guard lock(mutex);
  listener = call;
  listener_user = user;
}

DeviceList* rs2_query_devices(const Context*, Error**) {
  auto* list = new DeviceList;
  const std::lock_guard lock(mutex);
  list->units = plugged;
  return list;
}
int rs2_get_device_count(const DeviceList* list, Error**) {
  return static_cast<int>(list->units.size());
}
void rs2_delete_device_list(DeviceList* list) { delete list; }
int rs2_device_list_contains(const DeviceList* list, const Device* device, Error**) {
  return std::ranges::find(list->units, device->unit) == list->units.end() ? 0 : 1;
}
Device* rs2_create_device(const DeviceList* list, int index, Error** error) {
  const auto& unit = list->units.at(static_cast<std::size_t>(index));
  if (unit->is_gone) {
    Fail(error, "device is gone");
    return nullptr;
  }
  return With<Device>(unit);
}
void rs2_delete_device(Device* device) { delete device; }

int rs2_supports_device_info(const Device* device, int info, Error**) {
  const bool is_known = info == kInfoName || info == kInfoSerial || info == kInfoFirmware ||
                        info == kInfoAdvisedFirmware || info == kInfoUsbType ||
                        info == kInfoProductLine;
  return is_known && !(info == kInfoUsbType && device->unit->unit.usb.empty()) ? 1 : 0;
}
const char* rs2_get_device_info(const Device* device, int info, Error** error) {
  const FakeUnit& unit = device->unit->unit;
  switch (info) {
    case kInfoName:
      return unit.name.c_str();
    case kInfoSerial:
      return unit.serial.c_str();
    case kInfoFirmware:
      return unit.firmware.c_str();
    case kInfoAdvisedFirmware:
      return unit.advised_firmware.c_str();
    case kInfoUsbType:
      return unit.usb.c_str();
    case kInfoProductLine:
      return unit.line.c_str();
    default:
      Fail(error, "info is not supported");
      return nullptr;
  }
}

SensorList* rs2_query_sensors(const Device* device, Error**) {
  return With<SensorList>(device->unit);
}
int rs2_get_sensors_count(const SensorList* list, Error**) {
  return list->unit->unit.color_modes.empty() ? 1 : 2;
}
void rs2_delete_sensor_list(SensorList* list) { delete list; }
Sensor* rs2_create_sensor(const SensorList* list, int index, Error**) {
  auto* sensor = With<Sensor>(list->unit);
  sensor->index = index;
  return sensor;
}
void rs2_delete_sensor(Sensor* sensor) { delete sensor; }

ProfileList* rs2_get_stream_profiles(Sensor* sensor, Error**) {
  auto* list = new ProfileList;
  for (const FakeMode& mode : sensor->unit->modes(sensor->index))
    list->profiles.push_back({sensor->unit.get(), sensor->index, mode});
  return list;
}
int rs2_get_stream_profiles_count(const ProfileList* list, Error**) {
  return static_cast<int>(list->profiles.size());
}
const Profile* rs2_get_stream_profile(const ProfileList* list, int index, Error**) {
  return &list->profiles.at(static_cast<std::size_t>(index));
}
void rs2_delete_stream_profiles_list(ProfileList* list) { delete list; }
void rs2_get_stream_profile_data(const Profile* profile, int* stream, int* format, int* index,
                                 int* unique_id, int* rate_hz, Error**) {
  *stream = profile->mode.stream;
  *format = profile->mode.format;
  *index = *unique_id = 0;
  *rate_hz = profile->mode.rate_hz;
}
void rs2_get_video_stream_resolution(const Profile* profile, int* width, int* height, Error**) {
  *width = profile->mode.camera.width;
  *height = profile->mode.camera.height;
}
void rs2_get_video_stream_intrinsics(const Profile* profile, RsIntrinsics* camera, Error**) {
  *camera = profile->mode.camera;
}
void rs2_get_extrinsics(const Profile* from, const Profile* to, RsExtrinsics* pose, Error** error) {
  if (from->mode.stream != kStreamDepth || to->mode.stream != kStreamColor)
    return Fail(error, "only depth to colour is known");
  *pose = from->unit->unit.depth_to_color;
}
float rs2_get_depth_scale(Sensor* sensor, Error** error) {
  if (sensor->index != 0) Fail(error, "not a depth sensor");
  return sensor->unit->unit.depth_unit_m;
}

int rs2_supports_option(const Sensor* sensor, int option, Error**) {
  const bool is_depths =
      option == kOptionPreset || option == kOptionEmitter || option == kOptionLaserPower;
  return is_depths && sensor->index != 0 ? 0 : 1;
}
void rs2_get_option_range(const Sensor*, int option, float* least, float* most, float* step,
                          float* usual, Error**) {
  *least = 0;
  *most = option == kOptionLaserPower ? 360.0F : 10000.0F;
  *step = *usual = 1;
}
void rs2_set_option(const Sensor* sensor, int option, float value, Error** error) {
  if (rs2_supports_option(sensor, option, nullptr) == 0) return Fail(error, "not supported");
  const std::lock_guard lock(mutex);
  sensor->unit->options[{sensor->index, option}] = value;
}

void rs2_open_multiple(Sensor* sensor, const Profile** profiles, int count, Error** error) {
  for (int i = 0; i < count; ++i) {
    if (profiles[i]->sensor != sensor->index) return Fail(error, "profile of another sensor");
    sensor->opened.push_back(profiles[i]->mode.stream);
  }
}
void rs2_close(const Sensor*, Error**) {}
void rs2_start(const Sensor* sensor, FrameArrived call, void* user, Error** error) {
  if (sensor->unit->unit.busy) return Fail(error, "device or resource busy");
  const std::lock_guard lock(mutex);
  for (const int stream : sensor->opened) sensor->unit->started[stream] = {call, user};
  changed.notify_all();
}
void rs2_stop(const Sensor* sensor, Error**) {
  std::unique_lock lock(mutex);
  for (const int stream : sensor->opened) sensor->unit->started.erase(stream);
  changed.wait(lock, [&] { return sensor->unit->num_delivering == 0; });
}

const Profile* rs2_get_frame_stream_profile(const RsFrame* frame, Error**) {
  return &frame->profile;
}
const void* rs2_get_frame_data(const RsFrame* frame, Error**) { return frame->image.data; }
int rs2_get_frame_width(const RsFrame* frame, Error**) { return frame->image.width; }
int rs2_get_frame_height(const RsFrame* frame, Error**) { return frame->image.height; }
int rs2_get_frame_stride_in_bytes(const RsFrame* frame, Error**) { return frame->image.stride; }
unsigned long long rs2_get_frame_number(const RsFrame* frame, Error**) {
  return frame->image.number;
}
double rs2_get_frame_timestamp(const RsFrame* frame, Error**) { return frame->image.timestamp_ms; }
int rs2_supports_frame_metadata(const RsFrame* frame, int which, Error**) {
  return frame->image.metadata.contains(which) ? 1 : 0;
}
long long rs2_get_frame_metadata(const RsFrame* frame, int which, Error** error) {
  const auto found = frame->image.metadata.find(which);
  if (found != frame->image.metadata.end()) return found->second;
  Fail(error, "no such metadata");
  return 0;
}
void rs2_release_frame(RsFrame* frame) { delete frame; }

}  // extern "C"
