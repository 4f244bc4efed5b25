// From the approved plan of a reference to the options of the comparison with it.
#pragma once

#include "algo/comparison/comparison.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// What a live scan is compared with. Region, isocentre, tolerances, posture and kind of markers
/// come from the plan alone, also where it leaves them open (no region: the segmented body; no
/// isocentre: the region's centroid); everything else is as configured for the room.
/// @throws DataError naming the field of the plan that makes no sense: no scan is compared by
///         values that nobody approved.
[[nodiscard]] CompareOptions CompareOptionsFor(const web::ReferencePlan& plan,
                                               const CompareOptions& configured);

}  // namespace plumb
