// SPDX-License-Identifier: Apache-2.0
// Whether depth confirms a pose, for tracking and for loops alike.
#pragma once

#include "algo/tracking/pose_optimizer.hpp"

namespace plumb {

/// True if enough cells of the two depth images were associated, and lie close enough together.
///
/// Measured where poses were right: 2,300 to 3,800 of 4,800 cells while tracking and 155 to 2,200
/// in loops, apart by 1.4 to 3.0 mm RMS in a sweep of sim-a and by 2.1 to 6.1 mm on a real Kinect.
[[nodiscard]] inline bool SurfacesAgree(const PoseEstimate& estimate) {
  constexpr int kLeastCells = 300;
  constexpr double kLargestRms_m = 0.012;
  return estimate.num_dense > kLeastCells && estimate.dense_rms_m < kLargestRms_m;
}

}  // namespace plumb
