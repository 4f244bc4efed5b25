// SPDX-License-Identifier: Apache-2.0
// SensorSensitivity as a file.
#pragma once

#include <string>
#include <string_view>

#include "algo/sensor_model/sensor_sensitivity.hpp"

namespace plumb {

[[nodiscard]] std::string SensitivityJson(const SensorSensitivity& sensitivity);

/// @param name  Of the file, for messages. @throws DataError if the text is none.
[[nodiscard]] SensorSensitivity ParseSensitivityJson(std::string_view text,
                                                     const std::string& name);

}  // namespace plumb
