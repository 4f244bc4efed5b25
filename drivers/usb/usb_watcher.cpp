#include "drivers/usb/usb_watcher.hpp"

#include <libusb.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"

namespace plumb {
namespace {

constexpr std::uint16_t kPrimeSense = 0x1d27;

struct Model {
  std::uint16_t product;
  std::string_view name;
};
constexpr std::array kModels{Model{0x0200, "PrimeSense device"},
                             Model{0x0500, "PrimeSense sensor"},
                             Model{0x0600, "Xtion"},
                             Model{0x0601, "Xtion Pro Live"},
                             Model{0x0609, "Carmine"},
                             Model{0x1250, "PSLink sensor"},
                             Model{0x1260, "PSLink sensor"},
                             Model{0x1270, "PSLink sensor"},
                             Model{0x1280, "PSLink sensor"}};

std::string SpeedText(int speed) {
  switch (speed) {
    case LIBUSB_SPEED_LOW:
      return "1.5 Mbit/s";
    case LIBUSB_SPEED_FULL:
      return "12 Mbit/s";
    case LIBUSB_SPEED_HIGH:
      return "480 Mbit/s";
    case LIBUSB_SPEED_SUPER:
      return "5 Gbit/s";
    case LIBUSB_SPEED_SUPER_PLUS:
      return "10 Gbit/s";
    default:
      return "";
  }
}

/// True if a hub above the device, or its controller, is USB 3.
bool BehindUsb3(libusb_device* device) {
  for (libusb_device* hub = libusb_get_parent(device); hub != nullptr;
       hub = libusb_get_parent(hub)) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_speed(hub) >= LIBUSB_SPEED_SUPER) return true;
    if (libusb_get_device_descriptor(hub, &descriptor) == 0 && descriptor.bcdUSB >= 0x0300)
      return true;
  }
  return false;
}

UsbSensor Describe(libusb_device* device, const libusb_device_descriptor& descriptor) {
  UsbSensor sensor;
  sensor.bus = libusb_get_bus_number(device);
  sensor.address = libusb_get_device_address(device);
  sensor.vendor = descriptor.idVendor;
  sensor.product = descriptor.idProduct;
  sensor.model = UsbSensorModel(sensor.vendor, sensor.product).value_or("");
  const int speed = libusb_get_device_speed(device);
  sensor.speed = SpeedText(speed);
  const std::string node = fmt::format("/dev/bus/usb/{:03}/{:03}", sensor.bus, sensor.address);
  sensor.permitted = ::access(node.c_str(), R_OK | W_OK) == 0;
  if (!sensor.permitted) {
    sensor.problems.push_back(
        fmt::format("no permission for {}: install Plumb's udev rule (or the package "
                    "libopenni2-0), put the user into the group plumb, and plug the "
                    "sensor in again",
                    node));
  }
  if (speed == LIBUSB_SPEED_LOW || speed == LIBUSB_SPEED_FULL) {
    sensor.problems.push_back(fmt::format(
        "it runs at {} only, too slow for images: use another port or cable, without a hub",
        sensor.speed));
  }
  if (BehindUsb3(device)) {
    sensor.problems.push_back(
        "it is on a USB 3 controller: old Xtion firmware fails there (no device, or set_interface "
        "errors); if so use a USB 2 port, or "
        "update "
        "the firmware");
  }
  return sensor;
}

}  // namespace

std::optional<std::string> UsbSensorModel(std::uint16_t vendor, std::uint16_t product) {
  if (vendor != kPrimeSense) return std::nullopt;
  const auto found = std::find_if(kModels.begin(), kModels.end(),
                                  [&](const Model& model) { return model.product == product; });
  return found == kModels.end() ? "unknown PrimeSense device" : std::string(found->name);
}

struct UsbWatcher::Impl {
  libusb_context* context = nullptr;
  libusb_hotplug_callback_handle hotplug = 0;
  std::vector<UsbSensor> sensors;
  bool changed = false;
  std::function<void()> listener;
  std::function<void()> fd_listener;

  static int LIBUSB_CALL OnHotplug(libusb_context*, libusb_device* device,
                                   libusb_hotplug_event event, void* self) {
    static_cast<Impl*>(self)->OnDevice(device, event == LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED);
    return 0;
  }

  // A device may be reported twice: registering enumerates while events are pending.
  void OnDevice(libusb_device* device, bool arrived) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(device, &descriptor) != 0) return;
    const UsbSensor sensor = Describe(device, descriptor);
    std::erase_if(sensors, [&](const UsbSensor& known) {
      return known.bus == sensor.bus && known.address == sensor.address;
    });
    if (arrived) sensors.push_back(sensor);
    std::sort(sensors.begin(), sensors.end(), [](const auto& a, const auto& b) {
      return std::tie(a.bus, a.address) < std::tie(b.bus, b.address);
    });
    changed = true;
  }
};

UsbWatcher::UsbWatcher() : impl_(std::make_unique<Impl>()) {
  int status = libusb_init(&impl_->context);
  if (status != 0)
    throw DeviceError(fmt::format("libusb does not start: {}", libusb_error_name(status)));
  libusb_set_pollfd_notifiers(
      impl_->context,
      [](int, short, void* self) {
        if (auto& listener = static_cast<Impl*>(self)->fd_listener) listener();
      },
      [](int, void* self) {
        if (auto& listener = static_cast<Impl*>(self)->fd_listener) listener();
      },
      impl_.get());
  status = libusb_hotplug_register_callback(
      impl_->context, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT,
      LIBUSB_HOTPLUG_ENUMERATE, kPrimeSense, LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY,
      &Impl::OnHotplug, impl_.get(), &impl_->hotplug);
  if (status != 0) {
    libusb_exit(impl_->context);
    throw DeviceError(fmt::format("libusb cannot watch the bus: {}", libusb_error_name(status)));
  }
  impl_->changed = false;  // sensors attached at the start are not reported as new
}

UsbWatcher::~UsbWatcher() {
  libusb_set_pollfd_notifiers(impl_->context, nullptr, nullptr, nullptr);
  libusb_hotplug_deregister_callback(impl_->context, impl_->hotplug);
  libusb_exit(impl_->context);
}

const std::vector<UsbSensor>& UsbWatcher::sensors() const { return impl_->sensors; }

std::vector<pollfd> UsbWatcher::fds() const {
  std::vector<pollfd> fds;
  const libusb_pollfd** list = libusb_get_pollfds(impl_->context);
  if (list == nullptr) return fds;
  for (const libusb_pollfd** entry = list; *entry != nullptr; ++entry)
    fds.push_back({(*entry)->fd, (*entry)->events, 0});
  libusb_free_pollfds(list);
  return fds;
}

void UsbWatcher::SetFdListener(std::function<void()> changed) {
  impl_->fd_listener = std::move(changed);
}
void UsbWatcher::SetListener(std::function<void()> changed) {
  impl_->listener = std::move(changed);
}

void UsbWatcher::Dispatch() {
  timeval now{0, 0};
  const int status = libusb_handle_events_timeout_completed(impl_->context, &now, nullptr);
  if (status != 0 && status != LIBUSB_ERROR_INTERRUPTED && status != LIBUSB_ERROR_TIMEOUT)
    throw DeviceError(
        fmt::format("libusb cannot watch the USB bus any more: {}", libusb_error_name(status)));
  if (!std::exchange(impl_->changed, false)) return;
  if (impl_->listener) impl_->listener();
}

std::optional<UsbWatcher::Clock::time_point> UsbWatcher::deadline() const {
  timeval wait{};
  if (libusb_get_next_timeout(impl_->context, &wait) != 1) return std::nullopt;
  return Clock::now() + std::chrono::seconds(wait.tv_sec) + std::chrono::microseconds(wait.tv_usec);
}

}  // namespace plumb
