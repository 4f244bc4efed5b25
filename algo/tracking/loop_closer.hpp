// SPDX-License-Identifier: Apache-2.0
// Loop closure: which keyframes to compare with a new one, and how to correct the map so that both
// visits of a place agree.
#pragma once

#include <vector>

#include "algo/map/keyframe_link.hpp"
#include "algo/map/map.hpp"

namespace plumb {

/// Keyframes at least `kLoopMinGap` older than the newest that may show the same place although
/// they share few or no landmarks with it; likeliest first, at most four. The possible drift of the
/// map follows from the length of the path between them.
inline constexpr int kLoopMinGap = 12;
[[nodiscard]] std::vector<int> LoopCandidates(const TrackingMap& map);

/// Largest plausible drift between the newest keyframe's pose in the map and its pose as seen from
/// an older keyframe. Deliberately generous: it rejects places that only look alike and is not a
/// model of drift.
struct DriftBound {
  double translation_m = 0.0;
  double rotation_rad = 0.0;
};
[[nodiscard]] DriftBound LargestDrift(const TrackingMap& map, int older_keyframe);

/// Distributes the loop error over the keyframes by a pose graph (least squares; keyframe 0 is
/// fixed): keyframes keep their relative poses to those with common landmarks or to their
/// predecessor, and satisfy the loop's links. Landmarks and markers move with the keyframe that
/// observed them first. Single-threaded and deterministic.
void DistributeLoopError(const std::vector<KeyframeLink>& links, TrackingMap& map);

}  // namespace plumb
