// SPDX-License-Identifier: Apache-2.0
// The unit of depth images that nothing states, from the markers that they show.
#pragma once

#include <optional>

#include "algo/types/frame.hpp"

namespace plumb {

/// The unit, 1000 or 5000 for a metre, with which the depth on the markers' faces agrees with their
/// size within 30 %, from the first frames of a source that took another one or the same. Rarer
/// units are not taken so, because a wrong side of the markers passes for them: half the side for
/// 10000 instead of 5000.
/// @param source  Its info() states the unit that was taken; up to 120 frames are read.
/// @return nothing if too few faces have depth, they do not agree, or no unit is near.
[[nodiscard]] std::optional<double> DepthUnitByMarkers(FrameSource& source);

}  // namespace plumb
