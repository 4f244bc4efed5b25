// SPDX-License-Identifier: Apache-2.0
#include "tests/devices/orbbec/fake_orbbec.hpp"

#include <memory>
#include <utility>

#include "tests/devices/fake_ports.hpp"

using namespace plumb::fake_orbbec;

namespace {

using Ports = plumb::testing::FakePorts<FakeCamera, plumb::orbbec::FrameArrived,
                                        plumb::orbbec::DevicesChanged, plumb::orbbec::DeviceList>;
using Port = std::shared_ptr<Ports::Port>;

}  // namespace

namespace plumb::orbbec {

struct Error : Ports::Counted {
  std::string message;
};
struct Context : Ports::Counted {};
struct DeviceList : Ports::Counted {
  Ports::Ports ports;
};
struct Device : Ports::Counted {
  Port port;
};
struct DeviceInfo : Ports::Counted {
  FakeCamera camera;
};
struct Sensor : Ports::Counted {
  Port port;
  int type = 0;
};
struct ProfileList : Ports::Counted {
  Port port;
  int type = 0;
  [[nodiscard]] const std::vector<FakeMode>& modes() const {
    return type == kSensorDepth ? port->camera.depth_modes : port->camera.color_modes;
  }
};
struct Profile : Ports::Counted {
  Port port;
  int type = 0;
  FakeMode mode;
};
struct ObFrame : Ports::Counted {
  FakeImage image;
};

}  // namespace plumb::orbbec

using namespace plumb::orbbec;

namespace {

int version = 20807;

void Fail(Error** error, const std::string& why) {
  *error = new Error;
  (*error)->message = why;
}

}  // namespace

namespace plumb::fake_orbbec {

void Attach(FakeCamera camera) { Ports::Attach(std::move(camera)); }
void Detach(const std::string& serial) { Ports::Detach(serial); }

bool Deliver(const std::string& serial, const FakeImage& image) {
  return Ports::Deliver(serial, image.is_depth ? kSensorDepth : kSensorColor, [&](const auto&) {
    auto* frame = new ObFrame;
    frame->image = image;
    return frame;
  });
}

int PropertyOf(const std::string& serial, int property) {
  return static_cast<int>(Ports::SettingOf(serial, 0, property));
}

void SetVersion(int wanted) { version = wanted; }
int NumAlive() { return Ports::num_alive; }

void Reset() {
  Ports::Reset();
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
  Ports::Listen(nullptr, nullptr);
  delete context;
}
void ob_set_device_changed_callback(Context*, DevicesChanged call, void* user, Error**) {
  Ports::Listen(call, user);
}

DeviceList* ob_query_device_list(Context*, Error**) {
  auto* list = new DeviceList;
  list->ports = Ports::All();
  return list;
}
void ob_delete_device_list(DeviceList* list, Error**) { delete list; }
std::uint32_t ob_device_list_get_count(const DeviceList* list, Error**) {
  return static_cast<std::uint32_t>(list->ports.size());
}
const char* ob_device_list_get_device_serial_number(const DeviceList* list, std::uint32_t index,
                                                    Error**) {
  return list->ports.at(index)->camera.serial.c_str();
}
const char* ob_device_list_get_device_name(const DeviceList* list, std::uint32_t index, Error**) {
  return list->ports.at(index)->camera.name.c_str();
}
const char* ob_device_list_get_device_connection_type(const DeviceList* list, std::uint32_t index,
                                                      Error**) {
  return list->ports.at(index)->camera.port.c_str();
}
Device* ob_device_list_get_device(const DeviceList* list, std::uint32_t index, Error** error) {
  if (index >= list->ports.size()) {
    Fail(error, "index out of range");
    return nullptr;
  }
  const std::lock_guard lock(Ports::mutex);
  const Port& port = list->ports[index];
  if (std::exchange(port->is_open, true)) {
    Fail(error, "device has been acquired already");
    return nullptr;
  }
  auto* device = new Device;
  device->port = port;
  return device;
}
void ob_delete_device(Device* device, Error**) {
  {
    const std::lock_guard lock(Ports::mutex);
    device->port->is_open = false;
  }
  delete device;
}
DeviceInfo* ob_device_get_device_info(const Device* device, Error**) {
  auto* info = new DeviceInfo;
  info->camera = device->port->camera;
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
  Ports::Set(*device->port, 0, property, value ? 1 : 0);
}
void ob_device_set_int_property(Device* device, int property, std::int32_t value, Error** error) {
  const ObRange& range = device->port->camera.exposure;
  if (value < range.least || value > range.most) return Fail(error, "out of range");
  Ports::Set(*device->port, 0, property, static_cast<float>(value));
}
ObRange ob_device_get_int_property_range(Device* device, int, Error**) {
  return device->port->camera.exposure;
}

Sensor* ob_device_get_sensor(Device* device, int type, Error**) {
  auto* sensor = new Sensor;
  sensor->port = device->port;
  sensor->type = type;
  return sensor;
}
void ob_delete_sensor(Sensor* sensor, Error**) { delete sensor; }
ProfileList* ob_sensor_get_stream_profile_list(const Sensor* sensor, Error**) {
  auto* list = new ProfileList;
  list->port = sensor->port;
  list->type = sensor->type;
  return list;
}
std::uint32_t ob_stream_profile_list_get_count(const ProfileList* list, Error**) {
  return static_cast<std::uint32_t>(list->modes().size());
}
Profile* ob_stream_profile_list_get_profile(const ProfileList* list, int index, Error**) {
  auto* profile = new Profile;
  profile->port = list->port;
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
  return from->port->camera.depth_to_color;
}

void ob_sensor_start(Sensor* sensor, const Profile* profile, FrameArrived call, void* user,
                     Error** error) {
  if (sensor->port->camera.busy) return Fail(error, "device or resource busy");
  if (profile->type != sensor->type) return Fail(error, "profile of another sensor");
  Ports::Start(*sensor->port, sensor->type, call, user);
}
void ob_sensor_stop(Sensor* sensor, Error**) { Ports::Stop(*sensor->port, {sensor->type}); }

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
