// SPDX-License-Identifier: Apache-2.0
// Computes the pose of every frame from the refined keyframes.
#pragma once

#include <vector>

#include "algo/sensor_calibration/calibration_model.hpp"
#include "algo/tracking/tracker.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// World poses of the colour camera for each frame (identity where not tracked). A frame between
/// two keyframes takes its tracked motion from the first, plus the interpolated part of the
/// second's refinement.
[[nodiscard]] std::vector<Pose> ColorPoses(const std::vector<TrackedFrame>& frames,
                                           const TrackingMap& map);

/// Velocities by central differences over the neighbouring tracked frames. Written to the frames
/// and to the map's keyframes.
void RefreshVelocities(std::vector<TrackedFrame>& frames, TrackingMap& map);

/// All tracked frames at their depth stamps, in the scene's frame.
[[nodiscard]] std::vector<StampedPose> DepthTrajectory(const std::vector<TrackedFrame>& frames,
                                                       const TrackingMap& map,
                                                       const CalibrationModel& calibration,
                                                       const Pose& T_scene_world);

/// Longest time without a pose, seconds: between tracked frames that have lost frames between them
/// or are three times farther apart than usual (median spacing of the recording; images that never
/// arrived), and lost frames at either end.
[[nodiscard]] double LongestLost(const std::vector<TrackedFrame>& frames);

}  // namespace plumb
