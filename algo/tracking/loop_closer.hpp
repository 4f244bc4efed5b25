// A place seen again after a long way: which keyframes to compare with, and how to bend the map so that both visits agree.
#pragma once

#include <vector>

#include "algo/tracking/map.hpp"

namespace plumb {

/// Keyframes made at least `kLoopMinGap` before the newest that may show the same as it although they share (almost) no landmarks with it,
/// likeliest first, at most four. How far the map may have drifted is taken from the length of the way between.
inline constexpr int kLoopMinGap = 12;
[[nodiscard]] std::vector<int> LoopCandidates(const TrackingMap& map);

/// A drift is believed up to here: metres and radians between where a keyframe is in the map and where an older one sees it.
struct DriftBound {
  double translation_m = 0.0;
  double rotation_rad = 0.0;
};
[[nodiscard]] DriftBound LargestDrift(const TrackingMap& map, int from_keyframe, int to_keyframe);

/// How two keyframes stand to each other: T_a_b is keyframe b's colour camera in keyframe a's.
struct KeyframeLink {
  int a = 0;
  int b = 0;
  Pose T_a_b = Pose::Identity();
};

/// A link's least squares as normal equations in the twists of both cameras, on the cameras' side, for residuals
/// r = (log(R_ba' R_a^T R_b) / sigma_rad, (R_a^T (t_b - t_a) - t_ab') / sigma_m): 1/2 x' H x + g' x.
struct LinkEquations {
  Eigen::Matrix<double, 12, 12> H;
  Eigen::Matrix<double, 12, 1> g;
};
[[nodiscard]] LinkEquations Linearise(const KeyframeLink& link, const Pose& T_world_a, const Pose& T_world_b, double sigma_rad,
                                      double sigma_m);

/// Spreads the contradiction between the links and the map over the map: keyframes keep how they stand to those that they share landmarks
/// with or follow, and meet the links (pose graph, least squares; keyframe 0 stays). Landmarks and markers move with the keyframe that saw
/// them first. One thread, deterministic.
void BendMap(const std::vector<KeyframeLink>& links, TrackingMap& map);

}  // namespace plumb
