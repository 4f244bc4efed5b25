// SPDX-License-Identifier: Apache-2.0
// From the settings to the plan of a new reference, and from an approved plan to options of the
// comparison.
#pragma once

#include "algo/comparison/comparison.hpp"
#include "web/model/reference.hpp"
#include "web/model/settings.hpp"

namespace plumb {

/// Of a new reference, until a physicist has planned it.
[[nodiscard]] ReferencePlan DefaultPlan(const Settings& settings);

/// The comparison options of a live scan. Region, isocentre, tolerances, posture and kind of
/// markers come from the plan alone, also where it leaves them open (no region: the segmented body;
/// no isocentre: the region's centroid); everything else is as configured for the room.
/// @throws DataError naming the invalid field of the plan: no scan is compared with values that
///         nobody approved.
[[nodiscard]] CompareOptions CompareOptionsFor(const ReferencePlan& plan,
                                               const CompareOptions& configured);

}  // namespace plumb
