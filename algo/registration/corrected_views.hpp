// SPDX-License-Identifier: Apache-2.0
// Surfaces of the keyframes, from their depth images corrected by the calibration.
#pragma once

#include <vector>

#include "algo/base/intrinsics.hpp"
#include "algo/map/map.hpp"
#include "algo/registration/joint_registration.hpp"
#include "algo/surface/view_surface.hpp"

namespace plumb {

/// One surface for each keyframe that has images: depth corrected, converted to what a camera at
/// the stamp would have measured in one instant, with the corrected lens, seen from the scene's
/// frame. Releases the map's images during the conversion, so that the two copies never coexist in
/// memory. Runs in parallel on TBB's threads.
[[nodiscard]] std::vector<ViewSurface> PrepareCorrectedViews(TrackingMap& map,
                                                             const Intrinsics& stated,
                                                             const JointRegistrationResult& joint,
                                                             const Pose& T_scene_world,
                                                             const ViewSurfaceOptions& options);

}  // namespace plumb
