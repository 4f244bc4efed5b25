// SPDX-License-Identifier: Apache-2.0
#include "drivers/openni/openni_provider.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <mutex>
#include <span>

#include "algo/base/errors.hpp"
#include "algo/base/plain_text.hpp"
#include "drivers/live/sensor_events.hpp"
#include "drivers/openni/openni_library.hpp"
#include "drivers/openni/openni_sensor.hpp"
#include "words/sensor.hpp"

namespace plumb {

// OpenNI2 is never called with a lock of this class held, because it calls back from the driver's
// thread under its own locks.
struct OpenNiProvider::Impl {
  explicit Impl(const OpenNiOptions& wanted)
      : options(wanted), library(OpenNiLibrary::Load(wanted.library)) {
    callbacks.deviceConnected = [](const OniDeviceInfo*, void* self) {
      static_cast<Impl*>(self)->events.Notify();
    };
    callbacks.deviceDisconnected = [](const OniDeviceInfo* info, void* self) {
      static_cast<Impl*>(self)->OnGone(*info);
    };
    callbacks.deviceStateChanged = [](const OniDeviceInfo* info, OniDeviceState state, void* self) {
      static_cast<Impl*>(self)->OnState(*info, state);
    };
    library->Check(say::sensor::OpenniNoEvents(),
                   library->RegisterDeviceCallbacks(&callbacks, this, &handle));
  }
  ~Impl() {
    if (handle != nullptr) library->UnregisterDeviceCallbacks(handle);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void OnGone(const OniDeviceInfo& info) {
    events.Lose(info.uri);
    {
      const std::lock_guard lock(mutex);
      serials.erase(info.uri);
    }
    events.Notify();
  }

  void OnState(const OniDeviceInfo& info, OniDeviceState state) {
    // "Not ready" is also reported on unplugging, which has its own callback.
    if (state == ONI_DEVICE_STATE_ERROR || state == ONI_DEVICE_STATE_OK)
      events.SetFailed(info.uri, state == ONI_DEVICE_STATE_ERROR);
    events.Notify();
  }

  /// Reads the serial from the unit; empty if it cannot be opened or has none.
  std::string AskSerial(const OniDeviceInfo& info) const {
    OniDeviceHandle device = nullptr;
    if (library->DeviceOpen(info.uri, &device) != ONI_STATUS_OK) return {};
    std::array<char, ONI_MAX_STR> serial{};
    int size = static_cast<int>(serial.size());
    const OniStatus status =
        library->DeviceGetProperty(device, ONI_DEVICE_PROPERTY_SERIAL_NUMBER, serial.data(), &size);
    library->DeviceClose(device);
    serial.back() = '\0';
    return status == ONI_STATUS_OK ? AsPlainText(serial.data()) : std::string();
  }

  SensorDescription Describe(const OniDeviceInfo& info) {
    std::string serial;
    {
      const std::lock_guard lock(mutex);
      if (const auto known = serials.find(info.uri); known != serials.end()) serial = known->second;
    }
    if (serial.empty()) {
      serial = AskSerial(info);
      const std::lock_guard lock(mutex);
      if (!serial.empty()) serials[info.uri] = serial;
    }
    return {info.uri, serial.empty() ? info.uri : serial,
            AsPlainText(fmt::format("{} {}", info.vendor, info.name)), info.usbVendorId,
            info.usbProductId};
  }

  std::vector<SensorDescription> List() {
    OniDeviceInfo* infos = nullptr;
    int count = 0;
    library->Check(say::sensor::OpenniNoList(), library->GetDeviceList(&infos, &count));
    const std::vector<OniDeviceInfo> found(infos, infos + std::max(count, 0));
    library->ReleaseDeviceList(infos);
    std::vector<SensorDescription> sensors;
    for (const OniDeviceInfo& info : found) {
      const bool known = std::any_of(sensors.begin(), sensors.end(),
                                     [&](const auto& sensor) { return sensor.uri == info.uri; });
      if (!known) sensors.push_back(Describe(info));
    }
    std::sort(sensors.begin(), sensors.end(), [](const auto& a, const auto& b) {
      return std::tie(a.serial, a.uri) < std::tie(b.serial, b.uri);
    });
    return sensors;
  }

  const OpenNiOptions options;
  const std::shared_ptr<const OpenNiLibrary> library;
  OniDeviceCallbacks callbacks{};
  OniCallbackHandle handle = nullptr;

  SensorEvents events;

  std::mutex mutex;
  std::map<std::string, std::string> serials;  ///< By URI, for the attached units.
};

OpenNiProvider::OpenNiProvider(const OpenNiOptions& options)
    : impl_(std::make_shared<Impl>(options)) {}

OpenNiProvider::~OpenNiProvider() {
  SetListener(nullptr);
  if (impl_->options.before_stop) impl_->options.before_stop();
}

std::vector<SensorDescription> OpenNiProvider::List() { return impl_->List(); }

void OpenNiProvider::SetListener(std::function<void()> changed) {
  impl_->events.SetListener(std::move(changed));
}

std::unique_ptr<LiveSensor> OpenNiProvider::Open(const std::string& serial) {
  const std::vector<SensorDescription> sensors = List();
  const SensorDescription& found = ChooseSensor(sensors, serial);
  auto box =
      std::make_shared<FrameBox>(found.serial, impl_->options.max_gap, impl_->options.stall_time);
  impl_->events.Watch(found.uri, box);
  auto streams = std::make_unique<OpenNiStreams>(impl_->library, found);
  // The box is notified about unplugging from here on, so no event is missed between the listing
  // and the first image.
  if (box->lost()) throw DeviceLost(say::sensor::UnpluggedWhileOpened(found.serial));
  return std::make_unique<OpenNiSensor>(std::move(streams), std::move(box), impl_, found,
                                        impl_->options);
}

}  // namespace plumb
