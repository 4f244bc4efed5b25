// SPDX-License-Identifier: Apache-2.0
// The driver "openni", and the drivers that OpenNI2 finds beside its library: Debian's, and those
// for sensors of other makes. OpenNI2 silently skips a driver that it cannot use; the functions
// here state why.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "drivers/live/sensor_driver.hpp"

namespace plumb {

/// The driver "openni": sensors of the Xtion class.
void AddOpenNiDriver(SensorRegistry& registry);

struct OpenNiDriverFile {
  std::filesystem::path file;
  Message serves;           ///< The sensors that it supports, in words.
  bool is_debians = false;  ///< Part of Debian's package libopenni2-0.
  Message problem;          ///< Why OpenNI2 does not use it, with a remedy; empty if it does.
};

/// Where OpenNI2 looks for drivers: `OpenNI2/Drivers` beside the library that this program loads;
/// nothing if it cannot be loaded.
[[nodiscard]] std::optional<std::filesystem::path> OpenNiDriverFolder();

/// The drivers in a folder, by name; `libNAME.so` is left out if `libNAME.so.0` exists too. Each is
/// loaded to check that this works, so its own code runs.
[[nodiscard]] std::vector<OpenNiDriverFile> FindOpenNiDrivers(const std::filesystem::path& folder);

}  // namespace plumb
