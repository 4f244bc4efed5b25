// SPDX-License-Identifier: Apache-2.0
// The part of librealsense2's C interface that Plumb uses, declared here so that nothing of the
// library is needed to build Plumb. Names and values are those of its documentation (rs.h of
// version 2), and have been the same in all of its versions since 2.36.
#pragma once

#include <array>

namespace plumb::realsense {

// The library's objects, known by pointers only.
struct Context;
struct DeviceList;
struct Device;
struct SensorList;
struct Sensor;
struct ProfileList;
struct Profile;
struct RsFrame;
struct Error;

// What the library calls enumerations, as the C compiler passes them.
inline constexpr int kStreamDepth = 1, kStreamColor = 2;
inline constexpr int kFormatZ16 = 1, kFormatRgb8 = 5;
inline constexpr int kInfoName = 0, kInfoSerial = 1, kInfoFirmware = 2, kInfoAdvisedFirmware = 3,
                     kInfoUsbType = 9, kInfoProductLine = 10;
inline constexpr int kOptionExposure = 3, kOptionAutoExposure = 10, kOptionAutoWhiteBalance = 11,
                     kOptionPreset = 12, kOptionLaserPower = 13, kOptionEmitter = 18,
                     kOptionAutoExposurePriority = 30, kOptionGlobalTime = 53;
inline constexpr float kPresetHighAccuracy = 3.0F;
inline constexpr int kMetadataSensorTimestamp = 2, kMetadataExposure = 3;
inline constexpr int kDomainHardwareClock = 0, kDomainSystemTime = 1;
inline constexpr int kDistortionNone = 0, kDistortionModified = 1, kDistortionInverse = 2,
                     kDistortionBrownConrady = 4;

struct RsIntrinsics {
  int width = 0, height = 0;  ///< Pixels.
  float ppx = 0, ppy = 0, fx = 0, fy = 0;
  int model = kDistortionNone;
  std::array<float, 5> coefficients{};
};

struct RsExtrinsics {
  std::array<float, 9> rotation{};     ///< Column by column.
  std::array<float, 3> translation{};  ///< Metres.
};

using DevicesChanged = void (*)(DeviceList* removed, DeviceList* added, void* user);
using FrameArrived = void (*)(RsFrame* frame, void* user);

// X(result, name without "rs2_", parameters)
// clang-format off
#define PLUMB_RS_FUNCTIONS(X)                                                                      \
  X(int, get_api_version, (Error**))                                                               \
  X(const char*, get_error_message, (const Error*))                                                \
  X(void, free_error, (Error*))                                                                    \
  X(Context*, create_context, (int api_version, Error**))                                          \
  X(void, delete_context, (Context*))                                                              \
  X(void, set_devices_changed_callback, (const Context*, DevicesChanged, void* user, Error**))     \
  X(DeviceList*, query_devices, (const Context*, Error**))                                         \
  X(int, get_device_count, (const DeviceList*, Error**))                                           \
  X(void, delete_device_list, (DeviceList*))                                                       \
  X(int, device_list_contains, (const DeviceList*, const Device*, Error**))                        \
  X(Device*, create_device, (const DeviceList*, int index, Error**))                               \
  X(void, delete_device, (Device*))                                                                \
  X(int, supports_device_info, (const Device*, int info, Error**))                                 \
  X(const char*, get_device_info, (const Device*, int info, Error**))                              \
  X(SensorList*, query_sensors, (const Device*, Error**))                                          \
  X(int, get_sensors_count, (const SensorList*, Error**))                                          \
  X(void, delete_sensor_list, (SensorList*))                                                       \
  X(Sensor*, create_sensor, (const SensorList*, int index, Error**))                               \
  X(void, delete_sensor, (Sensor*))                                                                \
  X(ProfileList*, get_stream_profiles, (Sensor*, Error**))                                         \
  X(int, get_stream_profiles_count, (const ProfileList*, Error**))                                 \
  X(const Profile*, get_stream_profile, (const ProfileList*, int index, Error**))                  \
  X(void, delete_stream_profiles_list, (ProfileList*))                                             \
  X(void, get_stream_profile_data, (const Profile*, int* stream, int* format, int* index,          \
                                    int* unique_id, int* rate_hz, Error**))                        \
  X(void, get_video_stream_resolution, (const Profile*, int* width, int* height, Error**))         \
  X(void, get_video_stream_intrinsics, (const Profile*, RsIntrinsics*, Error**))                   \
  X(void, get_extrinsics, (const Profile* from, const Profile* to, RsExtrinsics*, Error**))        \
  X(float, get_depth_scale, (Sensor*, Error**))                                                    \
  X(int, supports_option, (const Sensor*, int option, Error**))                                    \
  X(void, get_option_range, (const Sensor*, int option, float* least, float* most, float* step,    \
                             float* usual, Error**))                                               \
  X(void, set_option, (const Sensor*, int option, float value, Error**))                           \
  X(void, open_multiple, (Sensor*, const Profile**, int count, Error**))                           \
  X(void, close, (const Sensor*, Error**))                                                         \
  X(void, start, (const Sensor*, FrameArrived, void* user, Error**))                               \
  X(void, stop, (const Sensor*, Error**))                                                          \
  X(const Profile*, get_frame_stream_profile, (const RsFrame*, Error**))                           \
  X(const void*, get_frame_data, (const RsFrame*, Error**))                                        \
  X(int, get_frame_width, (const RsFrame*, Error**))                                               \
  X(int, get_frame_height, (const RsFrame*, Error**))                                              \
  X(int, get_frame_stride_in_bytes, (const RsFrame*, Error**))                                     \
  X(unsigned long long, get_frame_number, (const RsFrame*, Error**))                               \
  X(double, get_frame_timestamp, (const RsFrame*, Error**))                                        \
  X(int, get_frame_timestamp_domain, (const RsFrame*, Error**))                                    \
  X(int, supports_frame_metadata, (const RsFrame*, int metadata, Error**))                         \
  X(long long, get_frame_metadata, (const RsFrame*, int metadata, Error**))                        \
  X(void, release_frame, (RsFrame*))
// clang-format on

}  // namespace plumb::realsense
