// SPDX-License-Identifier: Apache-2.0
#include "drivers/orbbec/orbbec_driver.hpp"

#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/orbbec/orbbec_sensor.hpp"
#include "drivers/sdk/sdk_host.hpp"
#include "words/sdk.hpp"

namespace plumb {
namespace {

using namespace orbbec;

struct OrbbecFirmware {
  std::string_view model;  ///< In the name of the device.
  const char *least, *advised;
};
// The table of the README of OrbbecSDK 2.8.7. Longer names come before those that they begin with.
constexpr std::array kOrbbecFirmware = {
    OrbbecFirmware{"Femto Mega I", "2.0.4", "2.0.5"},
    OrbbecFirmware{"Femto Mega", "1.3.0", "1.3.1"},
    OrbbecFirmware{"Femto Bolt", "1.1.2", "1.1.3"},
    OrbbecFirmware{"Astra 2", "2.8.20", "2.8.20"},
    OrbbecFirmware{"Gemini 210", "1.0.9", "1.0.9"},
    OrbbecFirmware{"Gemini 215", "1.0.9", "1.0.9"},
    OrbbecFirmware{"Gemini 2 L", "1.4.53", "1.5.2"},
    OrbbecFirmware{"Gemini 2", "1.4.92", "1.4.98"},
    OrbbecFirmware{"Gemini 335Lg", "1.3.46", "1.8.10"},
    OrbbecFirmware{"Gemini 33", "1.2.20", "1.8.10"},
};

/// What only an opened device states.
struct OrbbecDetails {
  std::string firmware;
  DepthSensor depth_sensor = DepthSensor::kActiveStereo;
};

class OrbbecHost : public SdkHost {
 public:
  explicit OrbbecHost(const SensorSettings& settings)
      : SdkHost("orbbec"),
        settings_(settings),
        library_(std::make_shared<OrbbecLibrary>(settings.library)),
        context_(library_->Own(
            library_->Call(say::sdk::NoContext(library_->file()), library_->create_context),
            library_->delete_context)) {
    callbacks_.emplace(*this);
    library_->Call(say::sdk::NoEvents(OrbbecTitle().name), library_->set_device_changed_callback,
                   context_.get(), &OrbbecHost::OnChanged, callbacks_->key());
  }

  [[nodiscard]] const SdkLibrary& library() const override { return *library_; }
  [[nodiscard]] std::vector<SdkAttached> Attached() override;
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::shared_ptr<SdkHost>& self,
                                                 SdkOpening opening) override;

 private:
  static void OnChanged(DeviceList* removed, DeviceList* added, void* key);
  [[nodiscard]] std::shared_ptr<const DeviceList> Devices() const;
  [[nodiscard]] std::uint32_t CountOf(const DeviceList* list) const {
    return library_->CallOr(std::uint32_t{0}, library_->device_list_get_count, list);
  }
  template <typename Function>
  [[nodiscard]] std::string TextOf(Function function, const DeviceList* list,
                                   std::uint32_t index) const {
    return SdkText(library_->CallOr(static_cast<const char*>(nullptr), function, list, index));
  }
  [[nodiscard]] std::string SerialOf(const DeviceList* list, std::uint32_t index) const {
    return TextOf(library_->device_list_get_device_serial_number, list, index);
  }
  /// Asked once for each time that it is plugged in: the library does not open a device twice.
  [[nodiscard]] OrbbecDetails DetailsOf(const DeviceList* list, std::uint32_t index,
                                        const std::string& serial);

  const SensorSettings settings_;
  const std::shared_ptr<const OrbbecLibrary> library_;
  const std::shared_ptr<Context> context_;
  std::mutex details_mutex_;
  std::map<std::string, OrbbecDetails> details_;       ///< By serial.
  std::optional<SdkCallbacks<OrbbecHost>> callbacks_;  // Ends before the context.
};

void OrbbecHost::OnChanged(DeviceList* removed, DeviceList* added, void* key) {
  // At the end of a host the lists are leaked.
  SdkCallbacks<OrbbecHost>::With(key, [&](OrbbecHost& self) {
    std::set<std::string> gone;
    for (std::uint32_t i = 0; removed != nullptr && i < self.CountOf(removed); ++i)
      gone.insert(self.SerialOf(removed, i));
    {
      const std::lock_guard lock(self.details_mutex_);
      for (const std::string& serial : gone) self.details_.erase(serial);
    }
    self.Lose([&](const Watched& watched) { return gone.contains(watched.serial); });
    for (DeviceList* list : {removed, added})
      if (list != nullptr) (void)self.library_->Try(self.library_->delete_device_list, list);
    self.events().Notify();
  });
}

std::shared_ptr<const DeviceList> OrbbecHost::Devices() const {
  return library_->Own(library_->Call(say::sdk::NoList(OrbbecTitle().name),
                                      library_->query_device_list, context_.get()),
                       library_->delete_device_list);
}

OrbbecDetails OrbbecHost::DetailsOf(const DeviceList* list, std::uint32_t index,
                                    const std::string& serial) {
  {
    const std::lock_guard lock(details_mutex_);
    if (const auto known = details_.find(serial); known != details_.end()) return known->second;
  }
  const OrbbecLibrary& library = *library_;
  const auto device = library.Own(
      library.CallOr(static_cast<Device*>(nullptr), library.device_list_get_device, list, index),
      library.delete_device);
  if (!device) return {};
  const auto info =
      library.Own(library.CallOr(static_cast<DeviceInfo*>(nullptr), library.device_get_device_info,
                                 static_cast<const Device*>(device.get())),
                  library.delete_device_info);
  if (!info) return {};
  const DeviceInfo* about = info.get();
  const int type = library.CallOr(-1, library.device_info_get_device_type, about);
  OrbbecDetails details{
      .firmware = SdkText(library.CallOr(static_cast<const char*>(nullptr),
                                         library.device_info_get_firmware_version, about))};
  if (type == kDeviceTypeTof) details.depth_sensor = DepthSensor::kTimeOfFlight;
  if (type == kDeviceTypeMonocular) details.depth_sensor = DepthSensor::kStructuredLight;
  const std::lock_guard lock(details_mutex_);
  details_[serial] = details;
  return details;
}

std::vector<SdkAttached> OrbbecHost::Attached() {
  const std::shared_ptr<const DeviceList> list = Devices();
  std::vector<SdkAttached> attached;
  for (std::uint32_t i = 0; i < CountOf(list.get()); ++i) {
    SdkUnit unit{.name = TextOf(library_->device_list_get_device_name, list.get(), i),
                 .serial = SerialOf(list.get(), i),
                 .updater = "OrbbecViewer"};
    if (unit.serial.empty()) continue;
    const std::string port =
        TextOf(library_->device_list_get_device_connection_type, list.get(), i);
    if (port.starts_with("USB")) unit.usb = port.substr(3);
    const OrbbecDetails details = DetailsOf(list.get(), i, unit.serial);
    unit.firmware = details.firmware;
    unit.depth_sensor = details.depth_sensor;
    for (const OrbbecFirmware& known : kOrbbecFirmware) {
      if (unit.name.find(known.model) == std::string::npos) continue;
      unit.least_firmware = known.least;
      unit.advised_firmware = known.advised;
      break;
    }
    attached.push_back({.unit = std::move(unit), .device = nullptr});
  }
  return attached;
}

std::unique_ptr<LiveSensor> OrbbecHost::Open(const std::shared_ptr<SdkHost>& self,
                                             SdkOpening opening) {
  const std::string& serial = opening.description.serial;
  const std::shared_ptr<const DeviceList> list = Devices();
  std::uint32_t index = 0;
  while (index < CountOf(list.get()) && SerialOf(list.get(), index) != serial) ++index;
  // The streams keep the context, too: the library's own objects end before it.
  const std::shared_ptr<const OrbbecLibrary> library(self, library_.get());
  std::shared_ptr<Device> device(
      library_->Call(say::sdk::NoStart(serial), library_->device_list_get_device, list.get(),
                     index),
      [library](Device* given) { (void)library->Try(library->delete_device, given); });
  auto streams = std::make_unique<OrbbecStreams>(library, std::move(device), opening.attached.unit);
  return std::make_unique<OrbbecSensor>(std::move(streams), std::move(opening), settings_);
}

}  // namespace

void AddOrbbecDriver(SensorRegistry& registry) {
  AddSdkDriver(registry, "orbbec", OrbbecTitle(), [](const SensorSettings& settings) {
    return std::make_shared<OrbbecHost>(settings);
  });
}

}  // namespace plumb
