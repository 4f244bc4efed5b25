// SPDX-License-Identifier: Apache-2.0
// The terms that hold weakly constrained keyframes at their tracked poses.
#pragma once

#include <vector>

#include "algo/bundle/quadratic_term.hpp"
#include "algo/map/map.hpp"

namespace plumb {

/// Appends a term for each keyframe that few observations constrain, or whose previous one they do
/// not: the relative pose that tracking found, as Linearise(KeyframeLink) states its residuals.
void AddTrackedLinks(const TrackingMap& map, std::vector<QuadraticTerm>& terms);

}  // namespace plumb
