// SPDX-License-Identifier: Apache-2.0
// Tolerances that apply until somebody sets others.
#pragma once

namespace plumb {

inline constexpr double kDefaultShiftTolerance_mm = 3.0;
inline constexpr double kDefaultRotationTolerance_deg = 1.0;

}  // namespace plumb
