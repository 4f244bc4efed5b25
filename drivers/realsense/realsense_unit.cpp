// SPDX-License-Identifier: Apache-2.0
#include "drivers/realsense/realsense_unit.hpp"

#include <array>
#include <cstdlib>

#include "algo/base/utf8.hpp"
#include "words/realsense.hpp"

namespace plumb::realsense {
namespace {

using FirmwareVersion = std::array<long, 4>;

constexpr std::size_t kMostText = 64;
// The notes of the library's releases ask for this one or a newer one on Linux.
constexpr const char* kLeastFirmware = "5.9.3.0";

std::string Text(const RealSenseLibrary& library, const Device* device, int info) {
  if (library.CallOr(0, library.supports_device_info, device, info) == 0) return {};
  const char* text =
      library.CallOr(static_cast<const char*>(nullptr), library.get_device_info, device, info);
  return text == nullptr ? std::string() : ValidUtf8(std::string(text).substr(0, kMostText));
}

/// Missing and damaged parts count as 0.
FirmwareVersion FirmwareIn(const std::string& text) {
  FirmwareVersion version{};
  const char* next = text.c_str();
  for (long& part : version) {
    char* end = nullptr;
    part = std::strtol(next, &end, 10);
    if (*end != '.') break;
    next = end + 1;
  }
  return version;
}

}  // namespace

RealSenseUnit UnitOf(const RealSenseLibrary& library, const Device* device) {
  const auto text = [&](int info) { return Text(library, device, info); };
  return {.name = text(kInfoName),
          .serial = text(kInfoSerial),
          .firmware = text(kInfoFirmware),
          .advised_firmware = text(kInfoAdvisedFirmware),
          .usb = text(kInfoUsbType),
          .line = text(kInfoProductLine)};
}

std::optional<Message> WhyUnusable(const RealSenseUnit& unit) {
  if (unit.usb.starts_with("2") || unit.usb.starts_with("1"))
    return say::realsense::Usb2(unit.serial, unit.usb);
  const bool is_old = unit.line == "D400" && !unit.firmware.empty() &&
                      FirmwareIn(unit.firmware) < FirmwareIn(kLeastFirmware);
  if (is_old) return say::realsense::OldFirmware(unit.serial, unit.firmware, kLeastFirmware);
  return std::nullopt;
}

std::optional<Message> FirmwareAdvice(const RealSenseUnit& unit) {
  if (unit.firmware.empty() || FirmwareIn(unit.firmware) >= FirmwareIn(unit.advised_firmware))
    return std::nullopt;
  return say::realsense::FirmwareAdvice(unit.serial, unit.firmware, unit.advised_firmware);
}

DepthSensor ClassOfLine(const std::string& line) {
  if (line == "L500") return DepthSensor::kTimeOfFlight;
  if (line == "SR300") return DepthSensor::kStructuredLight;
  return DepthSensor::kActiveStereo;
}

}  // namespace plumb::realsense
