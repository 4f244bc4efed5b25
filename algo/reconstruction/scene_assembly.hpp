// SPDX-License-Identifier: Apache-2.0
// Builds the scene from the solved map: its frame, its markers, its trajectory and its warnings.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "algo/diagnosis/diagnosis.hpp"
#include "algo/map/map.hpp"
#include "algo/sensor_calibration/calibration_model.hpp"
#include "algo/tracking/tracker.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// Part of a sweep's frames above which a scene warns that they were dropped.
inline constexpr double kDroppedToReport = 0.05;

/// Whether the reference marker was seen often enough to base the scene's frame on it.
[[nodiscard]] bool HasReferenceMarker(const StreamInfo& info, const TrackingMap& map);
/// The reference marker's frame if it was seen often enough, otherwise the first keyframe's.
[[nodiscard]] Pose SceneFromWorld(const StreamInfo& info, const TrackingMap& map);

/// A solved sweep. What it refers to must outlive it.
struct SolvedSweep {
  const StreamInfo& info;
  Preset preset = Preset::kBest;
  std::int64_t num_dropped = 0;  ///< Frames that never reached the tracker.
  const std::vector<TrackedFrame>& frames;
  const TrackingMap& map;
  CalibrationModel calibration = {};
  /// SceneMarker::sigma_m by id; a marker that is missing here gets 10 mm.
  std::map<int, double> marker_sigmas_m = {};
  Pose T_scene_world = Pose::Identity();
};

/// All of a scene except its surfaces.
[[nodiscard]] Scene MakeScene(const SolvedSweep& sweep);

/// Adds a warning if the scene does not lie in the reference marker's frame, or not reliably. Call
/// it once the frame is decided, which each preset does in its own way.
void WarnOfFrame(const StreamInfo& info, const TrackingMap& map, Scene& scene);

/// Adds what the sweep's symptoms say to the warnings and refusals.
void AddFindings(const Symptoms& symptoms, Scene& scene);

/// Adds a warning if a part of the surface rose and fell by more than 2 mm.
void WarnOfBreathing(Scene& scene);

/// Keeps a map that contains cells and warns about any other: a map without cells cannot be stored,
/// and an empty one compares with nothing.
void KeepHeightMap(HeightMap map, Scene& scene);

}  // namespace plumb
