// From the solved map to the scene: its frame, its markers, its trajectory, and what to warn of.
#pragma once

#include <cstdint>
#include <vector>

#include "algo/sensor_model/calibration_model.hpp"
#include "algo/tracking/map.hpp"
#include "algo/tracking/tracker.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// Whether the reference marker was seen often enough to build the scene's frame on it.
[[nodiscard]] bool HasReferenceMarker(const StreamInfo& info, const TrackingMap& map);
/// The reference marker's frame where it was seen often enough, else the first keyframe's.
[[nodiscard]] Pose SceneFromWorld(const StreamInfo& info, const TrackingMap& map);

/// All of a scene but its surfaces.
/// @param dropped  Frames that never reached the tracker.
[[nodiscard]] Scene MakeScene(const StreamInfo& info, Preset preset, std::int64_t dropped,
                              const std::vector<TrackedFrame>& frames, const TrackingMap& map,
                              const CalibrationModel& calibration, const Pose& T_scene_world);

/// Warns where the scene does not lie in the reference marker's frame, or not surely. To be called
/// once its frame is decided, which the presets do differently.
void WarnOfFrame(const StreamInfo& info, const TrackingMap& map, Scene& scene);

/// Keeps a map that shows something, and warns of any other: one without cells cannot even be
/// stored, and an empty one compares with nothing.
void KeepHeightMap(HeightMap map, Scene& scene);

}  // namespace plumb
