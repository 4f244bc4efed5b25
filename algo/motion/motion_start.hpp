// SPDX-License-Identifier: Apache-2.0
// Finds starting poses for the registration of two bodies that may lie far apart.
#pragma once

#include <vector>

#include "algo/base/pose.hpp"
#include "algo/motion/region.hpp"

namespace plumb {

/// Candidate motions (p_current = T * p_reference), best first, mutually different: yaw and shift
/// for which the heights above the two supports agree best, evaluated in both directions (a small
/// body inside a large one is not a match). Deterministic. Empty if either body is empty.
[[nodiscard]] std::vector<Pose> MotionStarts(const Body& reference, const Body& current);

}  // namespace plumb
