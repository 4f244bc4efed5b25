#include "algo/reconstruction/scene_assembly.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "algo/base/units.hpp"
#include "algo/reconstruction/joint_registration.hpp"
#include "algo/reconstruction/trajectory.hpp"
#include "algo/tracking/loop_closer.hpp"

namespace plumb {
namespace {

// Observations of the reference marker before the scene's frame is based on it. A sensor that
// hardly moves gives only one keyframe, so frames count too.
constexpr int kMinReferenceViews = 3;
constexpr int kMinReferenceFrames = 5;
// The depth of Kinect and Xtion sensors errs by about 1 %, the size of prints by up to 3 %.
constexpr double kUsualDepthScale = 0.02;
constexpr double kBreathingToReport_m = 2 * kMillimetre;
constexpr double kGapToReport_s = 0.5;  // The comparison gives no answer above 1 s.
constexpr double kDroppedToReport = 0.05;
// For a marker without a variance, because the solve's equations do not determine it: as the preset
// `paper` has it for a marker of one view. An alignment gives it less than a thousandth of a
// usual marker's weight.
constexpr double kUnplacedMarkerSigma_m = 0.01;

SceneMarker ToSceneMarker(const StreamInfo& info, const MapMarker& marker,
                          const Pose& T_scene_world, double sigma_m) {
  SceneMarker result;
  const MarkerCorners corners = CornersInMarkerFrame(info.marker_length_m);
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

}  // namespace

bool HasReferenceMarker(const StreamInfo& info, const TrackingMap& map) {
  if (!info.reference_marker) return false;
  const auto found = map.markers.find(*info.reference_marker);
  return found != map.markers.end() && (found->second.num_views >= kMinReferenceViews ||
                                        found->second.num_frames >= kMinReferenceFrames);
}

Pose SceneFromWorld(const StreamInfo& info, const TrackingMap& map) {
  if (HasReferenceMarker(info, map))
    return map.markers.at(*info.reference_marker).T_world_marker.inverse();
  return map.keyframes.front().T_world_color.inverse();
}

Scene MakeScene(const StreamInfo& info, Preset preset, std::int64_t dropped,
                const std::vector<TrackedFrame>& frames, const TrackingMap& map,
                const CalibrationModel& calibration, const std::map<int, double>& marker_sigmas_m,
                const Pose& T_scene_world) {
  Scene scene;
  scene.preset = preset;
  scene.frame =
      HasReferenceMarker(info, map) ? SceneFrame::kReferenceMarker : SceneFrame::kFirstKeyframe;
  scene.marker_dictionary = info.marker_dictionary;
  scene.marker_length_m = info.marker_length_m;
  scene.reference_marker = info.reference_marker;
  scene.warnings = info.warnings;
  for (const MapKeyframe& keyframe : map.keyframes)
    scene.keyframes.push_back(
        {keyframe.data.depth_time_s, T_scene_world * DepthPose(keyframe, calibration)});
  scene.trajectory = DepthTrajectory(frames, map, calibration, T_scene_world);
  scene.frames_total = static_cast<std::int64_t>(frames.size()) + dropped;
  scene.frames_tracked = static_cast<std::int64_t>(scene.trajectory.size());
  scene.frames_dropped = dropped;
  scene.frames_fewer_keypoints = std::count_if(
      frames.begin(), frames.end(), [](const TrackedFrame& f) { return f.fewer_keypoints; });
  scene.longest_lost_s = LongestLost(frames);
  for (const auto& [id, marker] : map.markers) {
    const auto sigma = marker_sigmas_m.find(id);
    scene.markers[id] =
        ToSceneMarker(info, marker, T_scene_world,
                      sigma == marker_sigmas_m.end() ? kUnplacedMarkerSigma_m : sigma->second);
  }
  if (scene.frames_tracked < scene.frames_total - dropped) {
    scene.warnings.push_back(fmt::format("{} of {} frames were not tracked, {:.2f} s at longest",
                                         scene.frames_total - dropped - scene.frames_tracked,
                                         scene.frames_total - dropped, scene.longest_lost_s));
  } else if (scene.longest_lost_s > kGapToReport_s) {
    scene.warnings.push_back(fmt::format(
        "no image came for {:.2f} s in the sweep; what the sensor passed meanwhile is missing",
        scene.longest_lost_s));
  }
  if (static_cast<double>(dropped) > kDroppedToReport * static_cast<double>(scene.frames_total)) {
    scene.warnings.push_back(fmt::format(
        "{} of {} frames were dropped, because the processor was busy: fewer views support the "
        "surface",
        dropped, scene.frames_total));
  }
  if (scene.frames_fewer_keypoints > 0) {
    scene.warnings.push_back(fmt::format(
        "{} of {} frames were tracked with fewer keypoints, because the processor was busy: the "
        "camera's path may be less accurate",
        scene.frames_fewer_keypoints, scene.frames_total));
  }
  if (map.keyframes.size() > 2 * kLoopMinGap && LongestReturn(map) < kLoopMinGap) {
    scene.warnings.push_back(
        "the sweep never returned to a place: only neighbouring images hold its path together; "
        "keep a marker in view for longer, or end the sweep where it began");
  }
  return scene;
}

void WarnOfFrame(const StreamInfo& info, const TrackingMap& map, Scene& scene) {
  if (scene.markers.empty()) {
    scene.warnings.push_back(
        "no marker was seen: the scene lies in the first keyframe's frame and cannot be "
        "compared");
  } else if (!info.reference_marker) {
    scene.warnings.push_back(
        "no reference marker is configured: the scene lies in the first keyframe's frame, "
        "without a height map");
  } else if (scene.frame == SceneFrame::kFirstKeyframe && scene.preset == Preset::kPaper) {
    scene.warnings.push_back(
        fmt::format("no keyframe measured reference marker {} in depth at all its corners: the "
                    "scene lies in the first keyframe's frame, "
                    "without a height map; keep the marker in view",
                    *info.reference_marker));
  } else if (scene.frame == SceneFrame::kFirstKeyframe) {
    const auto found = map.markers.find(*info.reference_marker);
    const MapMarker seen = found == map.markers.end() ? MapMarker{} : found->second;
    scene.warnings.push_back(
        fmt::format("reference marker {} was seen in {} keyframes and {} tracked frames, {} or "
                    "{} are needed: the scene lies in the first "
                    "keyframe's frame, without a height map; keep the marker in view",
                    *info.reference_marker, seen.num_views, seen.num_frames, kMinReferenceViews,
                    kMinReferenceFrames));
  } else if (const int views = scene.markers.at(*info.reference_marker).num_views;
             views < kMinReferenceViews) {
    scene.warnings.push_back(
        fmt::format("reference marker {} was seen from {} place{} only: the scene's frame is "
                    "less certain than that of a sweep",
                    *info.reference_marker, views, views == 1 ? "" : "s"));
  }
}

void WarnOfScale(double depth_scale, Scene& scene) {
  if (scene.markers.empty() || !(std::abs(depth_scale - 1.0) > kUsualDepthScale)) return;
  scene.warnings.push_back(
      fmt::format("the sensor's depth and the stated size of the markers disagree by {:.1f} %: "
                  "measure the side of a marker",
                  100 * std::abs(depth_scale - 1.0)));
}

void WarnOfBreathing(Scene& scene) {
  if (!scene.breathing || !(scene.breathing->amplitude_m > kBreathingToReport_m)) return;
  scene.warnings.push_back(fmt::format(
      "a part of the surface, such as chest and belly, rose and fell by {:.1f} mm during the "
      "sweep, every {:.1f} s: sweep while the breath is held",
      scene.breathing->amplitude_m / kMillimetre, scene.breathing->period_s));
}

void KeepHeightMap(HeightMap map, Scene& scene) {
  if (std::any_of(map.z.begin(), map.z.end(), [](float z) { return std::isfinite(z); })) {
    scene.height_map = std::move(map);
    return;
  }
  scene.warnings.push_back(fmt::format(
      "no surface was measured around reference marker {}, up to some decimetres below and above "
      "it: the scene has no height "
      "map and cannot be a reference; lay the marker flat beside the body and sweep over both",
      scene.reference_marker.value()));
}

}  // namespace plumb
