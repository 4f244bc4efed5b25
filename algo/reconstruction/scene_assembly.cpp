// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/scene_assembly.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "algo/base/units.hpp"
#include "algo/reconstruction/trajectory.hpp"
#include "algo/registration/depth_views.hpp"
#include "algo/tracking/loop_closer.hpp"
#include "words/reconstruction.hpp"

namespace plumb {
namespace {

// Observations of the reference marker before the scene's frame is based on it. A sensor that
// hardly moves gives only one keyframe, so frames count too.
constexpr int kMinReferenceViews = 3;
constexpr int kMinReferenceFrames = 5;
constexpr double kBreathingToReport_m = 2 * kMillimetre;
constexpr double kGapToReport_s = 0.5;  // The comparison gives no answer above 1 s.
// For a marker without a variance, because the solve's equations do not determine it: as the preset
// `paper` has it for a marker of one view. An alignment gives it less than a thousandth of a
// usual marker's weight.
constexpr double kUnplacedMarkerSigma_m = 0.01;

SceneMarker ToSceneMarker(const StreamInfo& info, const MapMarker& marker,
                          const Pose& T_scene_world, double sigma_m) {
  SceneMarker result;
  const MarkerCorners corners = CornersInMarkerFrame(info.room_markers.length_m);
  for (std::size_t i = 0; i < 4; ++i)
    result.corners[i] = T_scene_world * (marker.T_world_marker * corners[i]);
  result.num_views = marker.num_views;
  result.sigma_m = sigma_m;
  return result;
}

// Largest number of keyframes between two that show the same landmark or marker.
int LongestReturn(const TrackingMap& map) {
  std::map<std::pair<bool, int>, int> first_seen;  // By (is a marker, index or id).
  int longest = 0;
  for (int k = 0; k < static_cast<int>(map.keyframes.size()); ++k) {
    const MapKeyframe& keyframe = map.keyframe(k);
    const auto see = [&](bool is_marker, int id) {
      const auto [first, is_new] = first_seen.try_emplace({is_marker, id}, k);
      if (!is_new) longest = std::max(longest, k - first->second);
    };
    for (const KeypointObservation& o : keyframe.keypoints) see(false, o.landmark);
    for (const MarkerObservation& o : keyframe.data.markers) see(true, o.id);
  }
  return longest;
}

// Adds warnings of frames without a pose, dropped frames and a path without a return.
void WarnOfSweep(const TrackingMap& map, Scene& scene) {
  const std::int64_t dropped = scene.frames_dropped;
  if (scene.frames_tracked < scene.frames_total - dropped) {
    scene.warnings.push_back(
        say::reconstruction::FramesNotTracked(scene.frames_total - dropped - scene.frames_tracked,
                                              scene.frames_total - dropped, scene.longest_lost_s));
  } else if (scene.longest_lost_s > kGapToReport_s) {
    scene.warnings.push_back(say::reconstruction::NoImage(scene.longest_lost_s));
  }
  if (static_cast<double>(dropped) > kDroppedToReport * static_cast<double>(scene.frames_total)) {
    scene.warnings.push_back(say::reconstruction::FramesDropped(dropped, scene.frames_total));
  }
  if (scene.frames_fewer_keypoints > 0) {
    scene.warnings.push_back(
        say::reconstruction::FewerKeypoints(scene.frames_fewer_keypoints, scene.frames_total));
  }
  if (map.keyframes.size() > 2 * kLoopMinGap && LongestReturn(map) < kLoopMinGap) {
    scene.warnings.push_back(say::reconstruction::NoReturn());
  }
}

}  // namespace

bool HasReferenceMarker(const StreamInfo& info, const TrackingMap& map) {
  if (!info.room_markers.reference) return false;
  const auto found = map.markers.find(*info.room_markers.reference);
  return found != map.markers.end() && (found->second.num_views >= kMinReferenceViews ||
                                        found->second.num_frames >= kMinReferenceFrames);
}

Pose SceneFromWorld(const StreamInfo& info, const TrackingMap& map) {
  if (HasReferenceMarker(info, map))
    return map.markers.at(*info.room_markers.reference).T_world_marker.inverse();
  return map.keyframes.front().T_world_color.inverse();
}

Scene MakeScene(const SolvedSweep& sweep) {
  const StreamInfo& info = sweep.info;
  Scene scene;
  scene.preset = sweep.preset;
  scene.frame = HasReferenceMarker(info, sweep.map) ? SceneFrame::kReferenceMarker
                                                    : SceneFrame::kFirstKeyframe;
  scene.room_markers = info.room_markers;
  scene.depth_sensor = info.depth_sensor;
  scene.warnings = info.warnings;
  for (const MapKeyframe& keyframe : sweep.map.keyframes)
    scene.keyframes.push_back(
        {keyframe.data.depth_time_s, sweep.T_scene_world * DepthPose(keyframe, sweep.calibration)});
  scene.trajectory =
      DepthTrajectory(sweep.frames, sweep.map, sweep.calibration, sweep.T_scene_world);
  scene.frames_total = static_cast<std::int64_t>(sweep.frames.size()) + sweep.num_dropped;
  scene.frames_tracked = static_cast<std::int64_t>(scene.trajectory.size());
  scene.frames_dropped = sweep.num_dropped;
  scene.frames_fewer_keypoints =
      std::count_if(sweep.frames.begin(), sweep.frames.end(),
                    [](const TrackedFrame& f) { return f.fewer_keypoints; });
  scene.longest_lost_s = LongestLost(sweep.frames);
  for (const auto& [id, marker] : sweep.map.markers) {
    const auto sigma = sweep.marker_sigmas_m.find(id);
    scene.markers[id] = ToSceneMarker(
        info, marker, sweep.T_scene_world,
        sigma == sweep.marker_sigmas_m.end() ? kUnplacedMarkerSigma_m : sigma->second);
  }
  WarnOfSweep(sweep.map, scene);
  return scene;
}

void WarnOfFrame(const StreamInfo& info, const TrackingMap& map, Scene& scene) {
  if (scene.markers.empty()) {
    scene.warnings.push_back(say::reconstruction::NoMarker());
  } else if (!info.room_markers.reference) {
    scene.warnings.push_back(say::reconstruction::NoReferenceMarker());
  } else if (scene.frame == SceneFrame::kFirstKeyframe && scene.preset == Preset::kPaper) {
    scene.warnings.push_back(
        say::reconstruction::ReferenceWithoutDepth(*info.room_markers.reference));
  } else if (scene.frame == SceneFrame::kFirstKeyframe) {
    const auto found = map.markers.find(*info.room_markers.reference);
    const MapMarker seen = found == map.markers.end() ? MapMarker{} : found->second;
    scene.warnings.push_back(say::reconstruction::ReferenceSeldomSeen(
        *info.room_markers.reference, seen.num_views, seen.num_frames, kMinReferenceViews,
        kMinReferenceFrames));
  } else if (const int views = scene.markers.at(*info.room_markers.reference).num_views;
             views < kMinReferenceViews) {
    scene.warnings.push_back(
        say::reconstruction::ReferenceFewPlaces(*info.room_markers.reference, views));
  }
}

void AddFindings(const Symptoms& symptoms, Scene& scene) {
  scene.scale_doubt = ScaleDoubt(symptoms);
  if (const CalibrationFit& fit = symptoms.calibration; fit.num_terms > 0)
    scene.calibration_chi2_per_term = fit.chi2 / fit.num_terms;
  for (const Finding& finding : Diagnose(symptoms)) {
    scene.warnings.push_back(finding.message);
    if (finding.level == FindingLevel::kRefusal) scene.refusals.push_back(finding.message);
  }
}

void WarnOfBreathing(Scene& scene) {
  if (!scene.breathing || !(scene.breathing->amplitude_m > kBreathingToReport_m)) return;
  scene.warnings.push_back(say::reconstruction::Breathing(
      scene.breathing->amplitude_m / kMillimetre, scene.breathing->period_s));
}

void KeepHeightMap(HeightMap map, Scene& scene) {
  if (std::any_of(map.z.begin(), map.z.end(), [](float z) { return std::isfinite(z); })) {
    scene.height_map = std::move(map);
    return;
  }
  scene.warnings.push_back(say::reconstruction::NoHeightMap(scene.room_markers.reference.value()));
}

}  // namespace plumb
