// Bundle adjustment of the newest keyframes while sweeping: small, dense, at the sensor's word.
#pragma once

#include <vector>

#include "algo/base/intrinsics.hpp"
#include "algo/tracking/map.hpp"

namespace plumb {

struct LocalBundleOptions {
  std::vector<int> free_keyframes;  ///< To move, ascending; every other keyframe that shares their
                                    ///< landmarks or markers stays.
  int max_iterations = 4;
  double min_relative_decrease = 1e-3;  ///< Of the cost; an iteration that gains less is the last.
  double keypoint_sigma_px = 0.6;       ///< At 640 columns.
  double keypoint_depth_sigmas =
      1.5;  ///< Standard deviation of a keypoint's depth, in those of the noise model.
  double min_corner_sigma_px = 0.3;  ///< At 640 columns.
  double marker_length_m = 0.104;
};

struct LocalBundleSummary {
  int num_observations = 0;
  int num_iterations = 0;
  double initial_cost = 0;
  double final_cost = 0;
};

/// Moves the free keyframes, the landmarks and the markers that they see, in place, to a smaller
/// robust cost: keypoints' pixels and depths, marker corners' pixels. The calibration stays as
/// stated; BundleAdjust() is for the whole map and the calibration.
///
/// Levenberg-Marquardt with the landmarks eliminated (Schur complement) and Cauchy weights. One
/// thread, deterministic. A map in which the free keyframes see nothing, or a system that cannot be
/// solved, is left as it is.
LocalBundleSummary AdjustLocalMap(const Intrinsics& intrinsics, const LocalBundleOptions& options,
                                  TrackingMap& map);

}  // namespace plumb
