// Surfaces of the keyframes, from their depth images as the calibration corrects them.
#pragma once

#include <vector>

#include "algo/base/intrinsics.hpp"
#include "algo/reconstruction/view_surface.hpp"
#include "algo/sensor_model/calibration_model.hpp"
#include "algo/tracking/map.hpp"

namespace plumb {

/// One surface a keyframe that has images: depth corrected, as a camera at the stamp would have
/// measured it in one instant, in the lens as corrected, seen from the scene's frame. Releases the
/// map's images on the way, so that both are never there at once. Spread over TBB's threads.
[[nodiscard]] std::vector<ViewSurface> PrepareCorrectedViews(TrackingMap& map,
                                                             const Intrinsics& stated,
                                                             const CalibrationModel& calibration,
                                                             const Pose& T_scene_world,
                                                             const ViewSurfaceOptions& options);

}  // namespace plumb
