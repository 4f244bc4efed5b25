// The keyframes' depth images as the calibration corrects them.
#pragma once

#include <vector>

#include "algo/base/intrinsics.hpp"
#include "algo/sensor_model/calibration_model.hpp"
#include "algo/tracking/map.hpp"

namespace plumb {

/// One view a keyframe: depth corrected, as a camera at the stamp would have measured it in one
/// instant, in the lens as corrected, seen from the scene's frame. Releases the map's depth images.
/// Spread over TBB's threads.
[[nodiscard]] std::vector<DepthView> CorrectedViews(TrackingMap& map, const Intrinsics& stated,
                                                    const CalibrationModel& calibration,
                                                    const Pose& T_scene_world, bool keep_color);

}  // namespace plumb
