// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/device_class.hpp"

#include <array>
#include <string>

#include "algo/base/ascii_lower.hpp"

namespace plumb {
namespace {

struct NamedDevice {
  std::string_view part;  ///< Of the name: small letters and digits only.
  DepthSensor sensor;
};

/// "Kinect" alone is not here: three classes of sensors have had that name.
constexpr std::array kDevices = {
    NamedDevice{"azurekinect", DepthSensor::kTimeOfFlight},
    NamedDevice{"k4a", DepthSensor::kTimeOfFlight},
    NamedDevice{"femto", DepthSensor::kTimeOfFlight},
    NamedDevice{"kinectv2", DepthSensor::kTimeOfFlight},
    NamedDevice{"kinect2", DepthSensor::kTimeOfFlight},
    NamedDevice{"kinectone", DepthSensor::kTimeOfFlight},
    NamedDevice{"realsensel5", DepthSensor::kTimeOfFlight},
    NamedDevice{"iphone", DepthSensor::kLidar},
    NamedDevice{"ipad", DepthSensor::kLidar},
    NamedDevice{"realsensed4", DepthSensor::kActiveStereo},
    NamedDevice{"realsensesr3", DepthSensor::kStructuredLight},
    NamedDevice{"realsensef2", DepthSensor::kStructuredLight},
    NamedDevice{"gemini", DepthSensor::kActiveStereo},
    NamedDevice{"structuresensor", DepthSensor::kStructuredLight},
    NamedDevice{"kinectv1", DepthSensor::kStructuredLight},
    NamedDevice{"xbox360", DepthSensor::kStructuredLight},
    NamedDevice{"xtion", DepthSensor::kStructuredLight},
    NamedDevice{"primesense", DepthSensor::kStructuredLight},
    NamedDevice{"astra", DepthSensor::kStructuredLight},
};

}  // namespace

std::optional<DepthSensor> ClassOfDevice(std::string_view name) {
  // "Kinect for Windows v2" and "kinect_v2" are one device.
  std::string plain;
  for (const char c : AsciiLower(name))
    if ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9')) plain += c;
  if (const std::size_t at = plain.find("forwindows"); at != std::string::npos) plain.erase(at, 10);
  for (const NamedDevice& device : kDevices)
    if (plain.find(device.part) != std::string::npos) return device.sensor;
  return std::nullopt;
}

}  // namespace plumb
