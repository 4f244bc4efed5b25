// SPDX-License-Identifier: Apache-2.0
// The part of libfreenect's C interface that Plumb uses, declared here so that nothing of the
// library is needed to build Plumb. Names and values are those of its header of version 0.5.
#pragma once

#include <sys/time.h>

#include <cstdint>

namespace plumb::freenect {

// The library's objects, known by pointers only.
struct Context;
struct Device;

struct Attributes {
  Attributes* next = nullptr;
  const char* camera_serial = nullptr;
};

inline constexpr int kResolutionMedium = 1;
inline constexpr int kVideoRgb = 0;
inline constexpr int kDepthRegistered = 4;  ///< Millimetres, on the pixels of colour.
inline constexpr int kSubdeviceCamera = 2;
inline constexpr int kLogFatal = 0;
inline constexpr int kAutoExposure = 1 << 14, kAutoWhiteBalance = 1 << 1;

struct FrameMode {
  std::uint32_t reserved = 0;
  std::int32_t resolution = 0;
  std::int32_t format = 0;
  std::int32_t bytes = 0;
  std::int16_t width = 0, height = 0;
  std::int8_t data_bits = 0, padding_bits = 0, rate_hz = 0, is_valid = 0;
};
static_assert(sizeof(FrameMode) == 24);

using ImageArrived = void (*)(Device*, void* image, std::uint32_t stamp);

// X(result, name without "freenect_", parameters)
// clang-format off
#define PLUMB_FREENECT_FUNCTIONS(X)                                                     \
  X(int, init, (Context**, void* usb))                                                  \
  X(int, shutdown, (Context*))                                                          \
  X(void, set_log_level, (Context*, int level))                                         \
  X(int, process_events_timeout, (Context*, timeval*))                                  \
  X(int, num_devices, (Context*))                                                       \
  X(int, list_device_attributes, (Context*, Attributes**))                              \
  X(void, free_device_attributes, (Attributes*))                                        \
  X(void, select_subdevices, (Context*, int subdevices))                                \
  X(int, open_device_by_camera_serial, (Context*, Device**, const char* serial))        \
  X(int, close_device, (Device*))                                                       \
  X(void, set_user, (Device*, void*))                                                   \
  X(void*, get_user, (Device*))                                                         \
  X(void, set_depth_callback, (Device*, ImageArrived))                                  \
  X(void, set_video_callback, (Device*, ImageArrived))                                  \
  X(FrameMode, find_depth_mode, (int resolution, int format))                           \
  X(FrameMode, find_video_mode, (int resolution, int format))                           \
  X(int, set_depth_mode, (Device*, FrameMode))                                          \
  X(int, set_video_mode, (Device*, FrameMode))                                          \
  X(int, start_depth, (Device*))                                                        \
  X(int, start_video, (Device*))                                                        \
  X(int, stop_depth, (Device*))                                                         \
  X(int, stop_video, (Device*))                                                         \
  X(int, set_flag, (Device*, int flag, int value))
// clang-format on

}  // namespace plumb::freenect
