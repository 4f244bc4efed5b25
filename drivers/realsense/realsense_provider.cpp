// SPDX-License-Identifier: Apache-2.0
#include "drivers/realsense/realsense_provider.hpp"

#include <algorithm>
#include <map>
#include <mutex>
#include <utility>

#include <fmt/format.h>

#include "drivers/live/frame_box.hpp"
#include "drivers/live/sensor_events.hpp"
#include "drivers/realsense/realsense_sensor.hpp"
#include "words/realsense.hpp"
#include "words/sensor.hpp"

namespace plumb::realsense {
namespace {

// Depth and colour are not synchronised: less than half a period of 33.3 ms.
constexpr std::chrono::microseconds kLargestGap{16000};
constexpr std::chrono::milliseconds kStallTime{3000};

struct AttachedUnit {
  SensorDescription description;
  RealSenseUnit unit;
  std::shared_ptr<const Device> device;
};

}  // namespace

struct RealSenseProvider::Impl {
  explicit Impl(const SensorSettings& wanted)
      : settings(wanted),
        library(RealSenseLibrary::Load(wanted.library)),
        context(library->Call(say::realsense::NoContext(library->file()), library->create_context,
                              library->api_version()),
                library->delete_context) {
    void* key = nullptr;
    {
      const std::lock_guard lock(RegistryMutex());
      // A number in place of a pointer, because the library's thread may call once more after the
      // end of this object.
      static std::uintptr_t next = 1;
      id = next++;
      Registry()[id] = this;
      key = reinterpret_cast<void*>(id);
    }
    try {
      library->Call(say::realsense::NoEvents(), library->set_devices_changed_callback,
                    static_cast<const Context*>(context.get()), &Impl::OnChanged, key);
    } catch (...) {
      Unregister();
      throw;
    }
  }
  ~Impl() { Unregister(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  static std::mutex& RegistryMutex() {
    static std::mutex mutex;
    return mutex;
  }
  static std::map<std::uintptr_t, Impl*>& Registry() {
    static std::map<std::uintptr_t, Impl*> registry;
    return registry;
  }
  void Unregister() const {
    const std::lock_guard lock(RegistryMutex());
    Registry().erase(id);
  }

  static void OnChanged(DeviceList* removed, DeviceList* added, void* key) {
    const std::lock_guard lock(RegistryMutex());
    const auto found = Registry().find(reinterpret_cast<std::uintptr_t>(key));
    if (found == Registry().end()) return;  // The lists are leaked, at the end of a provider.
    Impl& self = *found->second;
    self.LoseThoseIn(removed);
    for (DeviceList* list : {removed, added})
      if (list != nullptr) self.library->delete_device_list(list);
    self.events.Notify();
  }

  void LoseThoseIn(const DeviceList* removed) {
    std::vector<std::string> lost;
    {
      const std::lock_guard lock(mutex);
      for (const auto& [device, description] : open) {
        if (library->CallOr(0, library->device_list_contains, removed, device) == 0) continue;
        lost.push_back(description.uri);
        ++times_unplugged[description.serial];
      }
    }
    for (const std::string& uri : lost) events.Lose(uri);
  }

  /// By serial. A camera that cannot be asked, as while it starts, is left out.
  std::vector<AttachedUnit> Attached() {
    const Message what = say::realsense::NoList();
    const Owned<DeviceList> list(
        library->Call(what, library->query_devices, static_cast<const Context*>(context.get())),
        library->delete_device_list);
    const int count =
        library->Call(what, library->get_device_count, static_cast<const DeviceList*>(list.get()));
    std::vector<AttachedUnit> attached;
    for (int i = 0; i < count; ++i) {
      Device* created = library->CallOr(static_cast<Device*>(nullptr), library->create_device,
                                        static_cast<const DeviceList*>(list.get()), i);
      if (created == nullptr) continue;
      const std::shared_ptr<Device> device(created, library->delete_device);
      RealSenseUnit unit = UnitOf(*library, created);
      if (unit.serial.empty()) continue;
      SensorDescription description = DescriptionOf(unit);
      attached.push_back({std::move(description), std::move(unit), device});
    }
    std::ranges::sort(attached, {}, [](const AttachedUnit& a) { return a.unit.serial; });
    return attached;
  }

  SensorDescription DescriptionOf(const RealSenseUnit& unit) {
    const std::lock_guard lock(mutex);
    return {.uri = fmt::format("realsense:{}:{}", unit.serial, times_unplugged[unit.serial]),
            .serial = unit.serial,
            .name = unit.name.empty() ? unit.serial : unit.name};
  }

  /// Reports its unplugging, until the result is released. That keeps the device until then.
  static std::shared_ptr<const void> Watch(const std::shared_ptr<Impl>& self,
                                           const std::shared_ptr<const Device>& device,
                                           const SensorDescription& description) {
    const std::lock_guard lock(self->mutex);
    self->open.emplace(device.get(), description);
    return {nullptr, [self, device](std::nullptr_t) {
              const std::lock_guard again(self->mutex);
              self->open.erase(device.get());
            }};
  }

  const SensorSettings settings;
  const std::shared_ptr<const RealSenseLibrary> library;
  Owned<Context> context;
  SensorEvents events;
  std::uintptr_t id = 0;

  // Nothing of the library but a comparison of devices is called while this is held.
  std::mutex mutex;
  std::map<const Device*, SensorDescription> open;
  std::map<std::string, int> times_unplugged;  ///< By serial.
};

RealSenseProvider::RealSenseProvider(const SensorSettings& settings)
    : impl_(std::make_shared<Impl>(settings)) {}

RealSenseProvider::~RealSenseProvider() { SetListener(nullptr); }

const RealSenseLibrary& RealSenseProvider::library() const { return *impl_->library; }

std::vector<RealSenseUnit> RealSenseProvider::Units() {
  std::vector<RealSenseUnit> units;
  for (AttachedUnit& attached : impl_->Attached()) units.push_back(std::move(attached.unit));
  return units;
}

std::vector<SensorDescription> RealSenseProvider::List() {
  std::vector<SensorDescription> sensors;
  for (AttachedUnit& attached : impl_->Attached())
    sensors.push_back(std::move(attached.description));
  return sensors;
}

void RealSenseProvider::SetListener(std::function<void()> changed) {
  impl_->events.SetListener(std::move(changed));
}

std::unique_ptr<LiveSensor> RealSenseProvider::Open(const std::string& serial) {
  std::vector<AttachedUnit> attached = impl_->Attached();
  std::vector<SensorDescription> sensors;
  for (const AttachedUnit& one : attached) sensors.push_back(one.description);
  const SensorDescription found = ChooseSensor(sensors, serial);
  AttachedUnit& chosen = *std::ranges::find(attached, found.serial,
                                            [](const AttachedUnit& a) { return a.unit.serial; });
  if (const std::optional<Message> why = WhyUnusable(chosen.unit)) throw DeviceError(*why);
  auto box = std::make_shared<FrameBox>(found.serial, kLargestGap, kStallTime);
  impl_->events.Watch(found.uri, box);
  std::shared_ptr<const void> watched = Impl::Watch(impl_, chosen.device, found);
  // The streams keep the context, too: the library's own objects end before it.
  auto streams = std::make_unique<RealSenseStreams>(
      std::shared_ptr<const RealSenseLibrary>(impl_, impl_->library.get()), chosen.device,
      found.serial);
  auto sensor = std::make_unique<RealSenseSensor>(std::move(streams), chosen.unit, impl_->settings,
                                                  found, box, std::move(watched));
  if (box->lost()) throw DeviceLost(say::sensor::UnpluggedWhileOpened(found.serial));
  return sensor;
}

}  // namespace plumb::realsense
