// SPDX-License-Identifier: Apache-2.0
// Whether breathing that a sweep shows is more than an error of its solution.
#pragma once

#include <span>
#include <vector>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/reconstruction/breathing.hpp"
#include "algo/sensor_calibration/calibration_model.hpp"

namespace plumb {

/// Where a solution of the sweep places the depth images.
struct SweepSolution {
  CalibrationModel calibration;
  std::vector<Pose> T_scene_depth = {};  ///< Of the views, at their stamps.
};

/// Replaces the patches' distances, which were measured under one solution, by those of another.
/// The read-out of the rows is left out: it moves a patch by less than its noise.
void MovePatches(const Intrinsics& stated, const SweepSolution& from, const SweepSolution& to,
                 std::span<SurfacePatch> patches);

/// Breathing is kept only if it is on a body, and if the solution without the dense terms does not
/// contradict it. The dense terms bend the path and the depth image until surfaces agree, and what
/// is left over can look like a rhythm. The other solution contradicts it if it would have shown a
/// rise of this size, but shows none.
/// @param found       Under the solution from which everything else is made.
/// @param on_body     The same with only the patches on a body free to move.
/// @param without_dense  That of the solution without the dense terms, likewise.
[[nodiscard]] Breathing CheckedBreathing(const Breathing& found, const Breathing& on_body,
                                         const Breathing& without_dense);

}  // namespace plumb
