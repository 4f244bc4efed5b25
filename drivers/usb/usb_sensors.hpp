// SPDX-License-Identifier: Apache-2.0
// Lists the depth cameras on the USB bus, and whether this user may open them. Their images,
// plugging and unplugging are handled by the sensor drivers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"

namespace plumb {

struct UsbSensor {
  int bus = 0;
  int address = 0;
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string model;              ///< For example "Xtion Pro Live".
  std::string speed;              ///< For example "480 Mbit/s"; empty if unknown.
  bool permitted = true;          ///< This user may open it.
  std::vector<Message> problems;  ///< Actual and possible obstacles, each with a remedy.
  bool operator==(const UsbSensor&) const = default;
};

/// Depth cameras that Plumb can use, by USB id; nothing for other devices.
[[nodiscard]] std::optional<std::string> UsbSensorModel(std::uint16_t vendor,
                                                        std::uint16_t product);
/// The maker's library by which a program delivers the frames of such a sensor to the driver
/// "stream"; empty for sensors that have a driver.
[[nodiscard]] std::string SdkOf(std::uint16_t vendor, std::uint16_t product);
/// The driver that uses such a sensor through its maker's library.
struct UsbDriver {
  std::string name;     ///< For `driver` in the [sensor] table; empty: OpenNI2, or none.
  std::string library;  ///< What has to be installed.
  std::string guide;    ///< Where the manual says how.
};
[[nodiscard]] UsbDriver DriverOf(std::uint16_t vendor, std::uint16_t product);
/// Debian's OpenNI2 has no driver for sensors of this vendor: it comes from their maker.
[[nodiscard]] bool NeedsForeignDriver(std::uint16_t vendor);

/// Attached sensors by bus and address. @throws DeviceError if libusb cannot list the bus.
[[nodiscard]] std::vector<UsbSensor> ListUsbSensors();

}  // namespace plumb
