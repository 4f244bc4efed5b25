// SPDX-License-Identifier: Apache-2.0
// OpenNI2, loaded at run time: the system's library, or the private copy of the virtual sensor.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "algo/base/message.hpp"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#include <OniCAPI.h>
#include <OniCProperties.h>
#pragma GCC diagnostic pop

namespace plumb {

/// The functions of one loaded and started library; its drivers are those in `OpenNI2/Drivers`
/// beside it. Stops the library when the last owner is destroyed. Thread-safe.
class OpenNiLibrary {
 public:
  /// @param file  Empty: libOpenNI2.so.0 of the system.
  /// @throws DeviceError if it cannot be loaded, is another library or does not start.
  [[nodiscard]] static std::shared_ptr<const OpenNiLibrary> Load(const std::filesystem::path& file);
  ~OpenNiLibrary();
  OpenNiLibrary(const OpenNiLibrary&) = delete;
  OpenNiLibrary& operator=(const OpenNiLibrary&) = delete;

  /// "what: status" with the library's last error of this thread.
  [[nodiscard]] Message Describe(Message what, OniStatus status) const;
  /// @throws DeviceError with Describe() unless the status is ok.
  void Check(Message what, OniStatus status) const;

// clang-format off
#define PLUMB_ONI_FUNCTIONS(X)                                                                                          \
  X(Initialize) X(Shutdown) X(GetExtendedError) X(GetDeviceList) X(ReleaseDeviceList) X(RegisterDeviceCallbacks)        \
  X(UnregisterDeviceCallbacks) X(WaitForAnyStream) X(DeviceOpen) X(DeviceClose) X(DeviceCreateStream)                   \
  X(DeviceEnableDepthColorSync) X(DeviceSetProperty) X(DeviceGetProperty) X(StreamDestroy) X(StreamStart) X(StreamStop) \
  X(StreamReadFrame) X(StreamSetProperty) X(StreamGetProperty) X(StreamIsPropertySupported) X(FrameRelease)             \
  X(CreateRecorder) X(RecorderAttachStream) X(RecorderStart) X(RecorderStop) X(RecorderDestroy)
// clang-format on
#define PLUMB_ONI_DECLARE(name) decltype(&::oni##name) name = nullptr;
  PLUMB_ONI_FUNCTIONS(PLUMB_ONI_DECLARE)
#undef PLUMB_ONI_DECLARE

 private:
  OpenNiLibrary() = default;
  void Resolve(void* handle, const std::string& name);

  bool started_ = false;
};

}  // namespace plumb
