// SPDX-License-Identifier: Apache-2.0
#include "tests/devices/realsense/fake_realsense.hpp"

#include <memory>
#include <optional>

#include "tests/devices/fake_ports.hpp"

using namespace plumb::fake_realsense;

namespace {

using Ports =
    plumb::testing::FakePorts<FakeUnit, plumb::realsense::FrameArrived,
                              plumb::realsense::DevicesChanged, plumb::realsense::DeviceList>;
using Port = std::shared_ptr<Ports::Port>;

}  // namespace

namespace plumb::realsense {

struct Error {
  std::string message;
};
struct Context : Ports::Counted {
  int version = 0;
};
struct DeviceList : Ports::Counted {
  Ports::Ports ports;
};
struct Device : Ports::Counted {
  Port port;
};
struct SensorList : Ports::Counted {
  Port port;
};
struct Profile {
  const Ports::Port* port = nullptr;
  int sensor = 0;
  FakeMode mode;
};
struct Sensor : Ports::Counted {
  Port port;
  int index = 0;
  std::vector<int> opened;  ///< Streams.
};
struct ProfileList : Ports::Counted {
  std::vector<Profile> profiles;
};
struct RsFrame : Ports::Counted {
  FakeImage image;
  Profile profile;
};

}  // namespace plumb::realsense

using namespace plumb::realsense;

namespace {

int api_version = 25605;

void Fail(Error** error, const std::string& why) {
  if (error != nullptr) *error = new Error{why};
}

template <typename Object>
Object* With(Port port) {
  auto* object = new Object;
  object->port = std::move(port);
  return object;
}

}  // namespace

namespace plumb::fake_realsense {

void Attach(FakeUnit unit) { Ports::Attach(std::move(unit)); }
void Detach(const std::string& serial) { Ports::Detach(serial); }

bool Deliver(const std::string& serial, const FakeImage& image) {
  return Ports::Deliver(serial, image.stream, [&](const Ports::Port& port) {
    auto* frame = new RsFrame;
    frame->image = image;
    frame->profile.port = &port;
    frame->profile.mode.stream = image.stream;
    frame->profile.mode.format = image.format;
    return frame;
  });
}

float OptionOf(const std::string& serial, int stream, int option) {
  bool has_color = false;
  {
    const std::lock_guard lock(Ports::mutex);
    const Port port = Ports::Find(serial);
    has_color = port && !port->camera.color_modes.empty();
  }
  return Ports::SettingOf(serial, stream == kStreamColor && has_color ? 1 : 0, option);
}

void SetVersion(int version) { api_version = version; }
int NumAlive() { return Ports::num_alive; }

void Reset() {
  Ports::Reset();
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
  Ports::Listen(nullptr, nullptr);
  delete context;
}
void rs2_set_devices_changed_callback(const Context*, DevicesChanged call, void* user, Error**) {
  Ports::Listen(call, user);
}

DeviceList* rs2_query_devices(const Context*, Error**) {
  auto* list = new DeviceList;
  list->ports = Ports::All();
  return list;
}
int rs2_get_device_count(const DeviceList* list, Error**) {
  return static_cast<int>(list->ports.size());
}
void rs2_delete_device_list(DeviceList* list) { delete list; }
int rs2_device_list_contains(const DeviceList* list, const Device* device, Error**) {
  return std::ranges::find(list->ports, device->port) == list->ports.end() ? 0 : 1;
}
Device* rs2_create_device(const DeviceList* list, int index, Error** error) {
  const Port& port = list->ports.at(static_cast<std::size_t>(index));
  if (port->is_gone) {
    Fail(error, "device is gone");
    return nullptr;
  }
  return With<Device>(port);
}
void rs2_delete_device(Device* device) { delete device; }

int rs2_supports_device_info(const Device* device, int info, Error**) {
  const bool is_known = info == kInfoName || info == kInfoSerial || info == kInfoFirmware ||
                        info == kInfoAdvisedFirmware || info == kInfoUsbType ||
                        info == kInfoProductLine;
  return is_known && !(info == kInfoUsbType && device->port->camera.usb.empty()) ? 1 : 0;
}
const char* rs2_get_device_info(const Device* device, int info, Error** error) {
  const FakeUnit& unit = device->port->camera;
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
  return With<SensorList>(device->port);
}
int rs2_get_sensors_count(const SensorList* list, Error**) {
  return list->port->camera.color_modes.empty() ? 1 : 2;
}
void rs2_delete_sensor_list(SensorList* list) { delete list; }
Sensor* rs2_create_sensor(const SensorList* list, int index, Error**) {
  auto* sensor = With<Sensor>(list->port);
  sensor->index = index;
  return sensor;
}
void rs2_delete_sensor(Sensor* sensor) { delete sensor; }

ProfileList* rs2_get_stream_profiles(Sensor* sensor, Error**) {
  auto* list = new ProfileList;
  const FakeUnit& unit = sensor->port->camera;
  for (const FakeMode& mode : sensor->index == 0 ? unit.depth_modes : unit.color_modes)
    list->profiles.push_back({sensor->port.get(), sensor->index, mode});
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
  *pose = from->port->camera.depth_to_color;
}
float rs2_get_depth_scale(Sensor* sensor, Error** error) {
  if (sensor->index != 0) Fail(error, "not a depth sensor");
  return sensor->port->camera.depth_unit_m;
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
  Ports::Set(*sensor->port, sensor->index, option, value);
}

void rs2_open_multiple(Sensor* sensor, const Profile** profiles, int count, Error** error) {
  for (int i = 0; i < count; ++i) {
    if (profiles[i]->sensor != sensor->index) return Fail(error, "profile of another sensor");
    sensor->opened.push_back(profiles[i]->mode.stream);
  }
}
void rs2_close(const Sensor*, Error**) {}
void rs2_start(const Sensor* sensor, FrameArrived call, void* user, Error** error) {
  if (sensor->port->camera.busy) return Fail(error, "device or resource busy");
  for (const int stream : sensor->opened) Ports::Start(*sensor->port, stream, call, user);
}
void rs2_stop(const Sensor* sensor, Error**) { Ports::Stop(*sensor->port, sensor->opened); }

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
int rs2_get_frame_timestamp_domain(const RsFrame* frame, Error**) {
  return frame->image.timestamp_domain;
}
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
