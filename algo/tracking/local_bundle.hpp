// Bundle adjustment of the newest keyframes during the sweep: small, dense, with the stated
// calibration.
#pragma once

#include <vector>

#include "algo/base/intrinsics.hpp"
#include "algo/tracking/map.hpp"
#include "algo/types/depth_noise.hpp"

namespace plumb {

struct LocalBundleOptions {
  /// Keyframes to move, ascending; every other keyframe that shares their landmarks or markers is
  /// fixed.
  std::vector<int> free_keyframes;
  int max_iterations = 4;
  /// Relative decrease of the cost below which an iteration is the last one.
  double min_relative_decrease = 1e-3;
  double keypoint_sigma_px = 0.6;  ///< In pixels at 640 columns.
  double keypoint_depth_sigmas =
      1.5;  ///< Standard deviation of a keypoint's depth relative to `depth_noise`.
  DepthNoise depth_noise = {};       ///< The sensor's, see StreamInfo.
  double min_corner_sigma_px = 0.3;  ///< In pixels at 640 columns.
  double marker_length_m = 0.0;      ///< Required: the room's, see CornersInMarkerFrame().
};

struct LocalBundleSummary {
  int num_observations = 0;
  int num_iterations = 0;
  double initial_cost = 0;
  double final_cost = 0;
};

/// Moves the free keyframes and the landmarks and markers that they observe, in place, to a smaller
/// robust cost of keypoint pixels and depths and marker corner pixels. The calibration stays as
/// stated; BundleAdjust() is for the whole map and the calibration.
///
/// Levenberg-Marquardt with eliminated landmarks (Schur complement) and Cauchy weights.
/// Single-threaded and deterministic. The map is left unchanged if the free keyframes observe
/// nothing or the system cannot be solved.
LocalBundleSummary AdjustLocalMap(const Intrinsics& intrinsics, const LocalBundleOptions& options,
                                  TrackingMap& map);

}  // namespace plumb
