// A place seen again after a long way: which keyframes to compare with, and how to correct the map
// so that both visits agree.
#pragma once

#include <vector>

#include "algo/tracking/keyframe_link.hpp"
#include "algo/tracking/map.hpp"

namespace plumb {

/// Keyframes made at least `kLoopMinGap` before the newest that may show the same as it although
/// they share (almost) no landmarks with it, likeliest first, at most four. How far the map may
/// have drifted is taken from the length of the way between.
inline constexpr int kLoopMinGap = 12;
[[nodiscard]] std::vector<int> LoopCandidates(const TrackingMap& map);

/// A drift is believed up to here: between where the newest keyframe is in the map and where an
/// older one sees it. Generous: it keeps out places that only look alike, it is no model of drift.
struct DriftBound {
  double translation_m = 0.0;
  double rotation_rad = 0.0;
};
[[nodiscard]] DriftBound LargestDrift(const TrackingMap& map, int older_keyframe);

/// Distributes the loop error between the links and the map over the keyframes: keyframes keep how
/// they stand to those that they share landmarks with or follow, and meet the links (pose graph,
/// least squares; keyframe 0 stays). Landmarks and markers move with the keyframe that saw them
/// first. One thread, deterministic.
void DistributeLoopError(const std::vector<KeyframeLink>& links, TrackingMap& map);

}  // namespace plumb
