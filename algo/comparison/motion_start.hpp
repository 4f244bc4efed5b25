// Finds starting poses for the registration of two bodies that may lie far apart.
#pragma once

#include <vector>

#include "algo/base/pose.hpp"
#include "algo/comparison/region.hpp"

namespace plumb {

struct MotionStartOptions {
  double max_yaw_rad =
      1.6;  ///< Half range of the search about the support's normal; 60 deg are required.
  /// 5 deg, or 26 mm at the end of a torso, which is well within reach of the refinement.
  double yaw_step_rad = 0.0873;
  /// Largest distance of the centroids, which missing parts move apart.
  double max_offset_m = 0.165;
  double offset_step_m = 0.03;
  /// Upper limit of one difference; body against floor costs as much.
  double height_limit_m = 0.04;
  std::size_t max_samples = 1500;  ///< Cells of the reference body that are compared.
  std::size_t num_starts = 6;
};

/// Candidate motions (p_current = T * p_reference), best first, mutually different: yaw and shift
/// for which the heights above the two supports agree best, evaluated in both directions (a small
/// body inside a large one is not a match). Deterministic. Empty if either body is empty.
[[nodiscard]] std::vector<Pose> MotionStarts(const Body& reference, const Body& current,
                                             const MotionStartOptions& options = {});

}  // namespace plumb
