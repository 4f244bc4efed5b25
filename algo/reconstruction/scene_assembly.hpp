// Builds the scene from the solved map: its frame, its markers, its trajectory and its warnings.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "algo/sensor_model/calibration_model.hpp"
#include "algo/tracking/map.hpp"
#include "algo/tracking/tracker.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// Whether the reference marker was seen often enough to base the scene's frame on it.
[[nodiscard]] bool HasReferenceMarker(const StreamInfo& info, const TrackingMap& map);
/// The reference marker's frame if it was seen often enough, otherwise the first keyframe's.
[[nodiscard]] Pose SceneFromWorld(const StreamInfo& info, const TrackingMap& map);

/// All of a scene except its surfaces.
/// @param dropped  Frames that never reached the tracker.
/// @param marker_sigmas_m  SceneMarker::sigma_m by id; a marker that is missing there gets 10 mm.
[[nodiscard]] Scene MakeScene(const StreamInfo& info, Preset preset, std::int64_t dropped,
                              const std::vector<TrackedFrame>& frames, const TrackingMap& map,
                              const CalibrationModel& calibration,
                              const std::map<int, double>& marker_sigmas_m,
                              const Pose& T_scene_world);

/// Adds a warning if the scene does not lie in the reference marker's frame, or not reliably. Call
/// it once the frame is decided, which each preset does in its own way.
void WarnOfFrame(const StreamInfo& info, const TrackingMap& map, Scene& scene);

/// Adds a warning if the sensor's depth and the markers disagree about lengths by more than the
/// depth of such sensors usually errs. The markers are then probably not of the stated size.
/// @param depth_scale  `depth_scale` of the estimated calibration.
void WarnOfScale(double depth_scale, Scene& scene);

/// Adds a warning if a part of the surface rose and fell by more than 2 mm.
void WarnOfBreathing(Scene& scene);

/// Keeps a map that contains cells and warns about any other: a map without cells cannot be stored,
/// and an empty one compares with nothing.
void KeepHeightMap(HeightMap map, Scene& scene);

}  // namespace plumb
