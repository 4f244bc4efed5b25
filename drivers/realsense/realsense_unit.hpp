// SPDX-License-Identifier: Apache-2.0
// What the library says of one attached camera, and whether Plumb can use it.
#pragma once

#include <optional>
#include <string>

#include "algo/sensor_model/depth_sensor.hpp"
#include "drivers/realsense/realsense_library.hpp"

namespace plumb::realsense {

struct RealSenseUnit {
  std::string name, serial;
  std::string firmware, advised_firmware;  ///< "5.16.0.1"; empty if not stated.
  std::string usb;                         ///< "3.2"; empty if not stated.
  std::string line;                        ///< "D400".
};

[[nodiscard]] RealSenseUnit UnitOf(const RealSenseLibrary& library, const Device* device);

/// Why it cannot be used: a USB 2 port, or firmware that the maker calls too old. Nothing if it
/// can.
[[nodiscard]] std::optional<Message> WhyUnusable(const RealSenseUnit& unit);
/// Its firmware is older than the library advises.
[[nodiscard]] std::optional<Message> FirmwareAdvice(const RealSenseUnit& unit);
[[nodiscard]] DepthSensor ClassOfLine(const std::string& line);

}  // namespace plumb::realsense
