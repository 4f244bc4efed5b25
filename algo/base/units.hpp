// SPDX-License-Identifier: Apache-2.0
// Named units. All quantities inside Plumb are SI (metres, seconds, radians).
#pragma once

#include <numbers>

namespace plumb {

inline constexpr double kMillimetre = 1e-3;
inline constexpr double kCentimetre = 1e-2;
inline constexpr double kTwoPi = 2.0 * std::numbers::pi;  // a full turn
inline constexpr double kDegree = std::numbers::pi / 180.0;
inline constexpr double kMillisecond = 1e-3;

}  // namespace plumb
