// SPDX-License-Identifier: Apache-2.0
// What a maker's library says of one attached camera, and whether Plumb can use it.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "algo/base/message.hpp"
#include "algo/sensor_model/depth_sensor.hpp"

namespace plumb {

struct SdkUnit {
  std::string name, serial;
  std::string firmware = {}, advised_firmware = {};  ///< "5.16.0.1"; empty if not stated.
  std::string least_firmware = {};                   ///< That the maker calls usable; empty: any.
  std::string updater = {};                          ///< The maker's program that updates it.
  std::string usb = {};                              ///< "3.2"; empty if not stated.
  bool needs_usb3 = true;
  DepthSensor depth_sensor = DepthSensor::kActiveStereo;
};

/// At most 64 valid characters of what the library states; nothing for a null pointer.
[[nodiscard]] std::string SdkText(const char* text);

/// Why it cannot be used: a USB 2 port, or firmware that the maker calls too old. Nothing if it
/// can.
[[nodiscard]] std::optional<Message> WhyUnusable(const SdkUnit& unit);
/// Its firmware is older than the maker advises.
[[nodiscard]] std::optional<Message> FirmwareAdvice(const SdkUnit& unit, const std::string& sdk);

}  // namespace plumb
