// SPDX-License-Identifier: Apache-2.0
// Where a body's surface lies higher or lower now than it was scanned, from above.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "algo/monitoring/motion_fit.hpp"
#include "algo/types/height_map.hpp"

namespace plumb {

/// Of one moment; scene frame.
struct LiveMap {
  HeightMap rise_m;                        ///< Vertical; NaN where nothing of the body is known.
  std::vector<std::uint8_t> missing = {};  ///< 1 where sensors should see the body and do not.
};

/// The mean of what the sensors see. Breathing and motion are in it: it is what the body does, not
/// what the fit leaves. Where something lies before the body, it is missing.
/// @param views  As for a fit, after the zero.
[[nodiscard]] LiveMap MakeLiveMap(std::span<const FitView> views);

}  // namespace plumb
