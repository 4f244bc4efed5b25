// SPDX-License-Identifier: Apache-2.0
#include "drivers/sdk/sdk_unit.hpp"

#include <cstring>

#include "algo/base/plain_text.hpp"
#include "drivers/sdk/version_numbers.hpp"
#include "words/sdk.hpp"

namespace plumb {

std::string SdkText(const char* text) {
  constexpr std::size_t kMostBytes = 64;
  return text == nullptr ? std::string()
                         : AsPlainText(std::string(text, ::strnlen(text, kMostBytes)));
}

std::optional<Message> WhyUnusable(const SdkUnit& unit) {
  if (unit.needs_usb3 && (unit.usb.starts_with("2") || unit.usb.starts_with("1")))
    return say::sdk::Usb2(unit.serial, unit.usb);
  const bool is_old = !unit.firmware.empty() && !unit.least_firmware.empty() &&
                      VersionNumbersIn(unit.firmware) < VersionNumbersIn(unit.least_firmware);
  if (is_old)
    return say::sdk::OldFirmware(unit.serial, unit.firmware, unit.least_firmware, unit.updater);
  return std::nullopt;
}

std::optional<Message> FirmwareAdvice(const SdkUnit& unit, const std::string& sdk) {
  if (unit.firmware.empty() ||
      VersionNumbersIn(unit.firmware) >= VersionNumbersIn(unit.advised_firmware))
    return std::nullopt;
  return say::sdk::FirmwareAdvice(unit.serial, unit.firmware, sdk, unit.advised_firmware);
}

}  // namespace plumb
