// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb/usb_sensors.hpp"

#include <libusb.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <tuple>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "words/sensor.hpp"
#include "words/stream.hpp"

namespace plumb {
namespace {

constexpr std::uint16_t kPrimeSense = 0x1d27;
constexpr std::uint16_t kOrbbec = 0x2bc5;
constexpr std::uint16_t kOrbbecUvc = 0x0600;  ///< The first product that its SDK 2 uses.
constexpr std::uint16_t kMicrosoft = 0x045e;
constexpr std::uint16_t kIntel = 0x8086;

struct Model {
  std::uint16_t vendor, product;
  std::string_view name;
};
constexpr std::array kModels{Model{kPrimeSense, 0x0200, "PrimeSense device"},
                             Model{kPrimeSense, 0x0500, "PrimeSense sensor"},
                             Model{kPrimeSense, 0x0600, "Xtion"},
                             Model{kPrimeSense, 0x0601, "Xtion Pro Live"},
                             Model{kPrimeSense, 0x0609, "Carmine"},
                             Model{kPrimeSense, 0x1250, "PSLink sensor"},
                             Model{kPrimeSense, 0x1260, "PSLink sensor"},
                             Model{kPrimeSense, 0x1270, "PSLink sensor"},
                             Model{kPrimeSense, 0x1280, "PSLink sensor"},
                             Model{kMicrosoft, 0x02ae, "Kinect for Xbox 360"},
                             Model{kMicrosoft, 0x02bf, "Kinect for Windows"},
                             Model{kMicrosoft, 0x02c4, "Kinect 2"},
                             Model{kMicrosoft, 0x02d8, "Kinect 2"},
                             Model{kMicrosoft, 0x097c, "Azure Kinect (depth)"},
                             Model{kIntel, 0x0ad3, "RealSense D415"},
                             Model{kIntel, 0x0b07, "RealSense D435"},
                             Model{kIntel, 0x0b3a, "RealSense D435i"},
                             Model{kIntel, 0x0b5b, "RealSense D405"},
                             Model{kIntel, 0x0b5c, "RealSense D455"},
                             Model{kIntel, 0x0b64, "RealSense L515"}};

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
    sensor.problems.push_back(say::sensor::UsbPermission(node));
  }
  if (speed == LIBUSB_SPEED_LOW || speed == LIBUSB_SPEED_FULL) {
    sensor.problems.push_back(say::sensor::UsbSlow(sensor.speed));
  }
  const std::string driver = DriverOf(sensor.vendor, sensor.product).name;
  const bool needs_usb3 =
      driver == "realsense" || driver == "orbbec" || !SdkOf(sensor.vendor, sensor.product).empty();
  if (needs_usb3 && speed == LIBUSB_SPEED_HIGH)
    sensor.problems.push_back(say::stream::Usb2(sensor.speed));
  if (!needs_usb3 && BehindUsb3(device)) {
    sensor.problems.push_back(say::sensor::Usb3());
  }
  return sensor;
}

}  // namespace

std::optional<std::string> UsbSensorModel(std::uint16_t vendor, std::uint16_t product) {
  const auto found = std::find_if(kModels.begin(), kModels.end(), [&](const Model& model) {
    return model.vendor == vendor && model.product == product;
  });
  if (found != kModels.end()) return std::string(found->name);
  if (vendor == kPrimeSense) return "unknown PrimeSense device";
  if (vendor == kOrbbec) return "Orbbec device";
  return std::nullopt;
}

std::string SdkOf(std::uint16_t vendor, std::uint16_t product) {
  if (vendor == kMicrosoft && product == 0x097c) return "libk4a";
  return {};
}

UsbDriver DriverOf(std::uint16_t vendor, std::uint16_t product) {
  if (vendor == kIntel) return {"realsense", "librealsense2", "docs/realsense.md"};
  if (vendor == kMicrosoft && (product == 0x02ae || product == 0x02bf))
    return {"freenect", "libfreenect0.5", "docs/freenect.md"};
  // Older ones speak OpenNI's protocol.
  if (vendor == kOrbbec && product >= kOrbbecUvc) return {"orbbec", "OrbbecSDK", "docs/orbbec.md"};
  return {};
}

bool NeedsForeignDriver(std::uint16_t vendor) { return vendor != kPrimeSense; }

std::vector<UsbSensor> ListUsbSensors() {
  libusb_context* context = nullptr;
  if (const int status = libusb_init(&context); status != 0)
    throw DeviceError(say::sensor::UsbStart(libusb_error_name(status)));
  libusb_device** devices = nullptr;
  const ssize_t count = libusb_get_device_list(context, &devices);
  std::vector<UsbSensor> sensors;
  for (ssize_t i = 0; i < count; ++i) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(devices[i], &descriptor) == 0 &&
        UsbSensorModel(descriptor.idVendor, descriptor.idProduct))
      sensors.push_back(Describe(devices[i], descriptor));
  }
  if (count >= 0) libusb_free_device_list(devices, /*unref_devices=*/1);
  libusb_exit(context);
  if (count < 0) {
    throw DeviceError(say::sensor::UsbList(libusb_error_name(static_cast<int>(count))));
  }
  std::sort(sensors.begin(), sensors.end(), [](const UsbSensor& a, const UsbSensor& b) {
    return std::tie(a.bus, a.address) < std::tie(b.bus, b.address);
  });
  return sensors;
}

}  // namespace plumb
