// SPDX-License-Identifier: Apache-2.0
// The part of OrbbecSDK 2's C interface that Plumb uses, declared here so that nothing of the
// library is needed to build Plumb. Names and values are those of its headers.
#pragma once

#include <array>
#include <cstdint>

namespace plumb::orbbec {

// The library's objects, known by pointers only.
struct Context;
struct DeviceList;
struct Device;
struct DeviceInfo;
struct Sensor;
struct ProfileList;
struct Profile;
struct ObFrame;
struct Error;

// What the library calls enumerations, as the C compiler passes them.
inline constexpr int kSensorColor = 2, kSensorDepth = 3;
inline constexpr int kFrameColor = 2, kFrameDepth = 3;
inline constexpr int kFormatY16 = 8, kFormatRgb = 22, kFormatZ16 = 28;
inline constexpr int kPropertyLaser = 3, kPropertyColorAutoExposure = 2000,
                     kPropertyColorExposure = 2001, kPropertyColorAutoWhiteBalance = 2003;
inline constexpr int kPermissionWrite = 2;
inline constexpr int kDeviceTypeMonocular = 0, kDeviceTypeTof = 2;
inline constexpr int kDistortionNone = 0, kDistortionModified = 1, kDistortionInverse = 2,
                     kDistortionBrownConrady = 3, kDistortionBrownConradyK6 = 4,
                     kDistortionKannalaBrandt = 5;
inline constexpr int kLogOff = 5;

struct ObIntrinsics {
  float fx = 0, fy = 0, cx = 0, cy = 0;
  std::int16_t width = 0, height = 0;
};
static_assert(sizeof(ObIntrinsics) == 20);

struct ObDistortion {
  float k1 = 0, k2 = 0, k3 = 0, k4 = 0, k5 = 0, k6 = 0, p1 = 0, p2 = 0;
  int model = kDistortionNone;
};
static_assert(sizeof(ObDistortion) == 36);

struct ObExtrinsics {
  std::array<float, 9> rotation{};     ///< Row by row.
  std::array<float, 3> translation{};  ///< Millimetres.
};

struct ObRange {
  std::int32_t current = 0, most = 0, least = 0, step = 0, usual = 0;
};

using DevicesChanged = void (*)(DeviceList* removed, DeviceList* added, void* user);
using FrameArrived = void (*)(ObFrame* frame, void* user);

// X(result, name without "ob_", parameters)
// clang-format off
#define PLUMB_OB_FUNCTIONS(X)                                                                      \
  X(int, get_version, ())                                                                          \
  X(const char*, error_get_message, (const Error*))                                                \
  X(void, delete_error, (Error**))                                                                 \
  X(void, set_logger_to_file, (int severity, const char* folder, Error**))                         \
  X(void, set_logger_to_console, (int severity, Error**))                                          \
  X(void, set_extensions_directory, (const char* folder, Error**))                                 \
  X(Context*, create_context, (Error**))                                                           \
  X(void, delete_context, (Context*, Error**))                                                     \
  X(void, set_device_changed_callback, (Context*, DevicesChanged, void* user, Error**))            \
  X(DeviceList*, query_device_list, (Context*, Error**))                                           \
  X(void, delete_device_list, (DeviceList*, Error**))                                              \
  X(std::uint32_t, device_list_get_count, (const DeviceList*, Error**))                            \
  X(const char*, device_list_get_device_serial_number, (const DeviceList*, std::uint32_t, Error**))\
  X(const char*, device_list_get_device_name, (const DeviceList*, std::uint32_t, Error**))         \
  X(const char*, device_list_get_device_connection_type, (const DeviceList*, std::uint32_t,        \
                                                          Error**))                                \
  X(Device*, device_list_get_device, (const DeviceList*, std::uint32_t, Error**))                  \
  X(void, delete_device, (Device*, Error**))                                                       \
  X(DeviceInfo*, device_get_device_info, (const Device*, Error**))                                 \
  X(void, delete_device_info, (DeviceInfo*, Error**))                                              \
  X(const char*, device_info_get_firmware_version, (const DeviceInfo*, Error**))                   \
  X(int, device_info_get_device_type, (const DeviceInfo*, Error**))                                \
  X(bool, device_is_property_supported, (const Device*, int property, int permission, Error**))    \
  X(void, device_set_bool_property, (Device*, int property, bool value, Error**))                  \
  X(void, device_set_int_property, (Device*, int property, std::int32_t value, Error**))           \
  X(ObRange, device_get_int_property_range, (Device*, int property, Error**))                      \
  X(Sensor*, device_get_sensor, (Device*, int type, Error**))                                      \
  X(void, delete_sensor, (Sensor*, Error**))                                                       \
  X(ProfileList*, sensor_get_stream_profile_list, (const Sensor*, Error**))                        \
  X(std::uint32_t, stream_profile_list_get_count, (const ProfileList*, Error**))                   \
  X(Profile*, stream_profile_list_get_profile, (const ProfileList*, int index, Error**))           \
  X(void, delete_stream_profile_list, (const ProfileList*, Error**))                               \
  X(void, delete_stream_profile, (const Profile*, Error**))                                        \
  X(int, stream_profile_get_format, (const Profile*, Error**))                                     \
  X(std::uint32_t, video_stream_profile_get_fps, (const Profile*, Error**))                        \
  X(std::uint32_t, video_stream_profile_get_width, (const Profile*, Error**))                      \
  X(std::uint32_t, video_stream_profile_get_height, (const Profile*, Error**))                     \
  X(ObIntrinsics, video_stream_profile_get_intrinsic, (const Profile*, Error**))                   \
  X(ObDistortion, video_stream_profile_get_distortion, (const Profile*, Error**))                  \
  X(ObExtrinsics, stream_profile_get_extrinsic_to, (const Profile* from, Profile* to, Error**))    \
  X(void, sensor_start, (Sensor*, const Profile*, FrameArrived, void* user, Error**))              \
  X(void, sensor_stop, (Sensor*, Error**))                                                         \
  X(int, frame_get_type, (const ObFrame*, Error**))                                                \
  X(int, frame_get_format, (const ObFrame*, Error**))                                              \
  X(std::uint64_t, frame_get_index, (const ObFrame*, Error**))                                     \
  X(std::uint64_t, frame_get_timestamp_us, (const ObFrame*, Error**))                              \
  X(std::uint8_t*, frame_get_data, (const ObFrame*, Error**))                                      \
  X(std::uint32_t, frame_get_data_size, (const ObFrame*, Error**))                                 \
  X(std::uint32_t, video_frame_get_width, (const ObFrame*, Error**))                               \
  X(std::uint32_t, video_frame_get_height, (const ObFrame*, Error**))                              \
  X(float, depth_frame_get_value_scale, (const ObFrame*, Error**))                                 \
  X(void, delete_frame, (const ObFrame*, Error**))
// clang-format on

}  // namespace plumb::orbbec
