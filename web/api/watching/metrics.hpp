// SPDX-License-Identifier: Apache-2.0
// The unit's state as numbers for the systems that clinics watch their machines with.
#pragma once

#include <string>

#include "web/model/status.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb::web {

inline constexpr const char* kMetricsType =
    "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// OpenMetrics 1.0. Nothing in it names a patient, a person or a scan.
/// @param certificate_left  As in AddMetricsRoute().
[[nodiscard]] std::string MetricsText(
    const Status& status, const Health& health, WallClock::time_point now,
    std::optional<std::chrono::seconds> certificate_left = std::nullopt);

}  // namespace plumb::web
