// SPDX-License-Identifier: Apache-2.0
// Trajectories in the TUM format: "time tx ty tz qx qy qz qw", one pose per line.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "algo/types/scene.hpp"

namespace plumb {

/// Seconds with 6 decimals, metres and unit quaternion (w >= 0) with 9.
[[nodiscard]] std::string TrajectoryText(std::span<const StampedPose> poses);

/// Reads what TrajectoryText() writes; comments (#) and empty lines are skipped.
/// @throws DataError naming file and line: a number that is missing or not finite, a quaternion
///         without unit length, stamps that do not increase.
[[nodiscard]] std::vector<StampedPose> ParseTrajectory(std::string_view text,
                                                       const std::string& name);

}  // namespace plumb
