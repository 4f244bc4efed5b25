// SPDX-License-Identifier: Apache-2.0
#include "drivers/realsense/realsense_driver.hpp"

#include <memory>
#include <optional>
#include <utility>

#include "drivers/realsense/realsense_sensor.hpp"
#include "drivers/sdk/sdk_host.hpp"
#include "words/sdk.hpp"

namespace plumb {
namespace {

using namespace realsense;

DepthSensor ClassOfLine(const std::string& line) {
  if (line == "L500") return DepthSensor::kTimeOfFlight;
  if (line == "SR300") return DepthSensor::kStructuredLight;
  return DepthSensor::kActiveStereo;
}

SdkUnit UnitOf(const RealSenseLibrary& library, const Device* device) {
  const auto text = [&](int info) -> std::string {
    if (library.CallOr(0, library.supports_device_info, device, info) == 0) return {};
    return SdkText(
        library.CallOr(static_cast<const char*>(nullptr), library.get_device_info, device, info));
  };
  const std::string line = text(kInfoProductLine);
  return {.name = text(kInfoName),
          .serial = text(kInfoSerial),
          .firmware = text(kInfoFirmware),
          .advised_firmware = text(kInfoAdvisedFirmware),
          // The notes of the library's releases ask for this one or a newer one on Linux.
          .least_firmware = line == "D400" ? "5.9.3.0" : "",
          .updater = "rs-fw-update",
          .usb = text(kInfoUsbType),
          .depth_sensor = ClassOfLine(line)};
}

class RealSenseHost : public SdkHost {
 public:
  explicit RealSenseHost(const SensorSettings& settings)
      : SdkHost("realsense"),
        settings_(settings),
        library_(std::make_shared<RealSenseLibrary>(settings.library)),
        context_(library_->Call(say::sdk::NoContext(library_->file()), library_->create_context,
                                library_->api_version()),
                 library_->delete_context) {
    callbacks_.emplace(*this);
    library_->Call(
        say::sdk::NoEvents(RealSenseTitle().name), library_->set_devices_changed_callback,
        static_cast<const Context*>(context_.get()), &RealSenseHost::OnChanged, callbacks_->key());
  }

  [[nodiscard]] const SdkLibrary& library() const override { return *library_; }
  [[nodiscard]] std::vector<SdkAttached> Attached() override;
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::shared_ptr<SdkHost>& self,
                                                 SdkOpening opening) override {
    auto device = std::static_pointer_cast<const Device>(opening.attached.device);
    // The streams keep the context, too: the library's own objects end before it.
    auto streams = std::make_unique<RealSenseStreams>(
        std::shared_ptr<const RealSenseLibrary>(self, library_.get()), std::move(device),
        opening.description.serial);
    return std::make_unique<RealSenseSensor>(std::move(streams), std::move(opening), settings_);
  }

 private:
  static void OnChanged(DeviceList* removed, DeviceList* added, void* key) {
    // At the end of a host the lists are leaked.
    SdkCallbacks<RealSenseHost>::With(key, [&](RealSenseHost& self) {
      const RealSenseLibrary& library = *self.library_;
      self.Lose([&](const Watched& watched) {
        return library.CallOr(0, library.device_list_contains,
                              static_cast<const DeviceList*>(removed),
                              static_cast<const Device*>(watched.device.get())) != 0;
      });
      for (DeviceList* list : {removed, added})
        if (list != nullptr) library.delete_device_list(list);
      self.events().Notify();
    });
  }

  const SensorSettings settings_;
  const std::shared_ptr<const RealSenseLibrary> library_;
  const Owned<Context> context_;
  std::optional<SdkCallbacks<RealSenseHost>> callbacks_;  // Ends before the context.
};

std::vector<SdkAttached> RealSenseHost::Attached() {
  const Message what = say::sdk::NoList(RealSenseTitle().name);
  const Owned<DeviceList> list(
      library_->Call(what, library_->query_devices, static_cast<const Context*>(context_.get())),
      library_->delete_device_list);
  const int count =
      library_->Call(what, library_->get_device_count, static_cast<const DeviceList*>(list.get()));
  std::vector<SdkAttached> attached;
  for (int i = 0; i < count; ++i) {
    Device* created = library_->CallOr(static_cast<Device*>(nullptr), library_->create_device,
                                       static_cast<const DeviceList*>(list.get()), i);
    if (created == nullptr) continue;
    const std::shared_ptr<Device> device(created, library_->delete_device);
    SdkUnit unit = UnitOf(*library_, created);
    if (!unit.serial.empty()) attached.push_back({std::move(unit), device});
  }
  return attached;
}

}  // namespace

void AddRealSenseDriver(SensorRegistry& registry) {
  AddSdkDriver(registry, "realsense", RealSenseTitle(), [](const SensorSettings& settings) {
    return std::make_shared<RealSenseHost>(settings);
  });
}

}  // namespace plumb
