// SPDX-License-Identifier: Apache-2.0
// The class of a depth camera by the name that its maker or a recording program gives it.
#pragma once

#include <optional>
#include <string_view>

#include "algo/sensor_model/depth_sensor.hpp"

namespace plumb {

/// Nothing for a name that is not known: a wrong class is worse than none, which warns.
[[nodiscard]] std::optional<DepthSensor> ClassOfDevice(std::string_view name);

}  // namespace plumb
