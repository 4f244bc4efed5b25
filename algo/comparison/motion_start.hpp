// Where a registration of two bodies may start: no assumption that they lie close together.
#pragma once

#include <vector>

#include "algo/base/pose.hpp"
#include "algo/comparison/region.hpp"

namespace plumb {

struct MotionStartOptions {
  double max_yaw_rad =
      1.6;  ///< Half range of the search about the support's normal: 60 deg are asked for.
  double yaw_step_rad =
      0.0873;  ///< 5 deg: 26 mm at the end of a torso, well inside the reach of what follows.
  double max_offset_m = 0.165;  ///< Of the centroids, which missing parts pull apart.
  double offset_step_m = 0.03;
  double height_limit_m = 0.04;    ///< Differences count up to this; body on floor counts as much.
  std::size_t max_samples = 1500;  ///< Cells of the reference body that are compared.
  std::size_t num_starts = 6;
};

/// Candidate motions (p_current = T * p_reference), best first, mutually different: yaw and shift
/// under which the heights over the two supports agree best, both ways round (a small body inside a
/// large one is no match). Deterministic. Empty if either body is empty.
[[nodiscard]] std::vector<Pose> MotionStarts(const Body& reference, const Body& current,
                                             const MotionStartOptions& options = {});

}  // namespace plumb
