// SPDX-License-Identifier: Apache-2.0
// A sensor unit's profile as a JSON file.
#pragma once

#include <filesystem>
#include <string>

#include "algo/sensor_calibration/sensor_profile.hpp"

namespace plumb {

/// Names the profile after the file.
/// @throws DataError if the file is missing, too large, not a profile or of another version, or its
///         covariance is not positive definite.
[[nodiscard]] SensorProfile ReadSensorProfile(const std::filesystem::path& file);

/// As ReadSensorProfile(), for a text; the name is left empty. @throws DataError
[[nodiscard]] SensorProfile ParseSensorProfile(const std::string& text);

/// Replaces the file atomically, or leaves it unchanged. @throws IoError
void WriteSensorProfile(const SensorProfile& profile, const std::filesystem::path& file);

[[nodiscard]] std::string SensorProfileJson(const SensorProfile& profile);

}  // namespace plumb
