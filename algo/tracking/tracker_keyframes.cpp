// SPDX-License-Identifier: Apache-2.0
// Keyframes of the tracker: when one is made, what it observes, and loops.
#include <algorithm>
#include <cmath>
#include <utility>

#include "algo/base/statistics.hpp"
#include "algo/bundle/bundle_adjustment.hpp"
#include "algo/geometry/working_image.hpp"
#include "algo/tracking/loop_closer.hpp"
#include "algo/tracking/map_budget.hpp"
#include "algo/tracking/surface_agreement.hpp"
#include "algo/tracking/tracker.hpp"
#include "algo/tracking/view_geometry.hpp"

namespace plumb {
namespace {

constexpr std::size_t kReassociated =
    3;  // Older keyframes whose landmarks are searched in a new keyframe.
// Drift up to which bundle adjustment corrects the map without loop closure, once the old landmarks
// are observed again.
constexpr double kDriftFollowed_m = 0.003;
constexpr double kDriftFollowed_rad = 0.001;
// Keyframes not compared after one that matched no older keyframe: a scene in view stays for
// several keyframes, and a comparison costs as much as tracking a frame.
constexpr int kLongestLoopPause = 2;
// Features, and keypoints after them, that must agree to recognise a place.
constexpr int kLoopInliers = 30;
// Lost keypoints alone make a keyframe only once the camera has moved, or hardly any are left:
// where it stands still, others would be found in the same places.
constexpr double kSmallMove_m = 0.01;
constexpr double kSmallMove_rad = 0.01;
constexpr std::size_t kFewPointsLeft = 30;

// Median of a view's usable cells, metres; 1 without any.
double MedianDepth(const DenseView& view) {
  std::vector<float> z;
  for (const float value : view.z_m)
    if (value > 0) z.push_back(value);
  return z.empty() ? 1.0 : TakeMedian(z);
}

}  // namespace

bool Tracker::NeedsKeyframe(const Pose& T_world_color) const {
  const MapKeyframe& keyframe = ReferenceKeyframe();
  const Pose T_keyframe_now = keyframe.T_world_color.inverse() * T_world_color;
  if (T_keyframe_now.translation().norm() > options_.keyframe_distance * ScaleOfView(keyframe))
    return true;
  if (RotationAngle(T_keyframe_now) > options_.keyframe_angle_rad) return true;
  return options_.use_keypoints &&
         static_cast<double>(followed_points_.points().size()) <
             options_.min_tracked_fraction * static_cast<double>(reference_count_) &&
         (T_keyframe_now.translation().norm() > kSmallMove_m ||
          RotationAngle(T_keyframe_now) > kSmallMove_rad ||
          followed_points_.points().size() < kFewPointsLeft);
}

// The nearest by pose of the first `count` keyframes with a similar view. The reference is
// excluded while it is being tracked.
std::vector<std::size_t> Tracker::KeyframesNear(const Pose& T_world_color,
                                                std::size_t count) const {
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t k = 0; k < count; ++k) {
    if (!lost_ && static_cast<int>(k) == reference_) continue;
    if (map_.keyframes[k].gray.empty()) continue;
    const double distance = ViewDistance(map_.keyframes[k], T_world_color);
    if (distance < kViewReach) near.emplace_back(distance, k);
  }
  std::sort(near.begin(), near.end());
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < std::min(kReassociated, near.size()); ++i)
    result.push_back(near[i].second);
  return result;
}

void Tracker::MakeKeyframe(const Frame& frame, FrameData& prepared, const Pose& T_world_color,
                           TrackedFrame& result) {
  FindAllMarkers(prepared);
  if (options_.keep_working_images && !map_.keyframes.empty()) {
    // Keypoints are observed in the newest keyframe only.
    DepthView& before = map_.keyframes.back().data.view;
    before.depth_m = WorkingDepth(before.depth_m, info_.intrinsics, info_.depth_noise);
  }
  MapKeyframe keyframe;
  keyframe.data.frame_index = frame.index;
  keyframe.data.color_time_s = frame.color_time_s;
  keyframe.data.depth_time_s = frame.depth_time_s;
  keyframe.data.view.intrinsics = info_.intrinsics;
  keyframe.data.view.depth_m = frame.depth_m;
  if (options_.keep_color)
    keyframe.data.view.color_rgb = options_.keep_working_images
                                       ? WorkingColor(frame.color_rgb, info_.intrinsics)
                                       : frame.color_rgb;
  keyframe.data.markers = prepared.markers;
  keyframe.T_world_color = T_world_color;
  keyframe.velocity_per_s = velocity_;
  keyframe.dense = dense_maker_.Make(frame.depth_m);
  keyframe.median_depth_m = MedianDepth(keyframe.dense);
  keyframe.gray = prepared.image.gray;
  const int index = static_cast<int>(map_.keyframes.size());
  if (options_.use_keypoints) {
    AssociateKeyframe(prepared, frame.depth_m, T_world_color, keyframe);
    if (result.fewer_keypoints) followed_points_.KeepOnePerCell();
    followed_points_.AddCorners(prepared.image, frame.depth_m, index, result.fewer_keypoints,
                                keyframe);
    followed_points_.KeepPyramid(static_cast<std::size_t>(index), prepared.image.pyramid);
  }
  AddNewMarkers(frame.depth_m, keyframe);
  if (reference_) {
    result.previous_keyframe = reference_;
    result.T_previous_color = ReferenceKeyframe().T_world_color.inverse() * T_world_color;
  }
  keyframe.previous = reference_;
  keyframe.T_previous_color = result.T_previous_color;
  map_.keyframes.push_back(std::move(keyframe));
  reference_ = index;
  keyframe_wanted_ = false;
  lost_ = false;
  AdjustLocally(index);
  if (options_.use_keypoints) CloseLoop(prepared, index);
  BoundImages(options_.max_images, map_);
  reference_count_ = followed_points_.points().size();
  const Pose T_adjusted = map_.keyframes.back().T_world_color;
  T_world_last_ = T_adjusted;
  last_time_s_ = frame.color_time_s;
  result.keyframe = index;
  result.reference_keyframe = index;
  result.T_reference_color = Pose::Identity();
}

// Features cost as much as tracking a frame, and most keyframes are never compared by them.
void Tracker::Describe(int index) {
  MapKeyframe& keyframe = map_.keyframe(index);
  if (!keyframe.descriptors.empty() || keyframe.gray.empty()) return;
  DescribedFeatures features =
      DescribeFeatures(keyframe.gray, keyframe.data.view.depth_m, info_.intrinsics);
  keyframe.features_px = std::move(features.pixels);
  keyframe.features_camera = std::move(features.in_camera);
  keyframe.descriptors = features.descriptors;
}

// Compares the features of all keyframes, the newest first, and describes them only as far as
// needed.
std::optional<Relocalization> Tracker::FindAmongKeyframes(const DescribedFeatures& features) {
  std::optional<Relocalization> best;
  for (int k = static_cast<int>(map_.keyframes.size()) - 1; k >= 0; --k) {
    Describe(k);
    const auto found = RelocalizeByFeatures(map_, info_.intrinsics, features, {k});
    if (!found || (best && found->num_inliers <= best->num_inliers)) continue;
    best = found;
    if (best->num_inliers >= kBeyondDoubt) break;
  }
  return best;
}

// Loop closure at a place seen long ago: if the map has drifted since, the loop error is
// distributed, and the old landmarks are tracked again.
void Tracker::CloseLoop(const FrameData& prepared, int index) {
  if (loop_pause_ > 0) {
    --loop_pause_;
    return;
  }
  const std::vector<int> candidates = LoopCandidates(map_);
  if (candidates.empty()) return;
  for (const int k : candidates) Describe(k);
  Describe(index);
  const MapKeyframe& newest = map_.keyframes.back();
  const auto found = RelocalizeByFeatures(
      map_, info_.intrinsics, {newest.features_px, newest.features_camera, newest.descriptors},
      candidates);
  num_unlike_ = found ? 0 : num_unlike_ + 1;
  loop_pause_ = std::min(num_unlike_, kLongestLoopPause);
  if (!found || found->num_inliers < kLoopInliers) return;
  const std::optional<Pose> T_world_seen =
      EstimatePoseFromKeyframe(found->keyframe, found->T_world_color, prepared, newest);
  if (!T_world_seen) return;
  const Pose T_drift = newest.T_world_color.inverse() * *T_world_seen;
  const DriftBound bound = LargestDrift(map_, found->keyframe);
  if (T_drift.translation().norm() > bound.translation_m ||
      RotationAngle(T_drift) > bound.rotation_rad)
    return;
  if (T_drift.translation().norm() > kDriftFollowed_m ||
      RotationAngle(T_drift) > kDriftFollowed_rad) {
    const Pose& T_world_old = map_.keyframe(found->keyframe).T_world_color;
    loops_.push_back({found->keyframe, index, T_world_old.inverse() * *T_world_seen});
    DistributeLoopError(loops_, map_);
  }

  MapKeyframe& keyframe = map_.keyframes.back();
  const std::size_t known = followed_points_.points().size();
  std::vector<PosePoint> points;
  followed_points_.Reassociate(prepared.image, keyframe.data.view.depth_m, keyframe.T_world_color,
                               KeyframesNear(keyframe.T_world_color, map_.keyframes.size()),
                               points);
  followed_points_.Observe(points, known, keyframe);
  AdjustLocally(index);
}

// Pose of the newest keyframe from an older keyframe's neighbourhood alone (landmarks and depth).
// Nothing if they do not agree well.
std::optional<Pose> Tracker::EstimatePoseFromKeyframe(int older, const Pose& T_world_guess,
                                                      const FrameData& prepared,
                                                      const MapKeyframe& newest) {
  const std::vector<ActivePoint> followed = followed_points_.points();
  followed_points_.SetPoints({});
  const std::optional<int> followed_reference = std::exchange(reference_, older);
  PoseProblem problem = MakeProblem(prepared, newest.data.depth_time_s - newest.data.color_time_s);
  reference_.reset();  // No landmark is left.
  followed_points_.Reassociate(prepared.image, newest.data.view.depth_m, T_world_guess,
                               KeyframesNear(T_world_guess, static_cast<std::size_t>(older) + 4),
                               problem.points);
  const PoseEstimate estimate = OptimizePose(problem, T_world_guess);
  followed_points_.SetPoints(followed);
  reference_ = followed_reference;
  if (estimate.num_inliers < kLoopInliers ||
      2 * estimate.num_inliers < static_cast<int>(problem.points.size()) ||
      (options_.use_dense && !SurfacesAgree(estimate)))
    return std::nullopt;
  return estimate.T_world_camera;
}

// Observations in a new keyframe: tracked landmarks and rediscovered landmarks of older
// keyframes.
void Tracker::AssociateKeyframe(const FrameData& prepared, const cv::Mat& depth_m,
                                const Pose& T_world_color, MapKeyframe& keyframe) {
  const std::size_t followed = followed_points_.points().size();
  std::vector<PosePoint> found;
  followed_points_.Reassociate(prepared.image, depth_m, T_world_color,
                               KeyframesNear(T_world_color, map_.keyframes.size()), found);
  for (std::size_t i = 0; i < followed; ++i)
    followed_points_.AddObservation(followed_points_.points()[i], keyframe);
  followed_points_.Observe(found, followed, keyframe);
}

void Tracker::AddNewMarkers(const cv::Mat& depth_m, const MapKeyframe& keyframe) {
  for (const MarkerObservation& m : keyframe.data.markers) {
    auto known = map_.markers.find(m.id);
    if (known == map_.markers.end()) {
      const auto T_camera_marker =
          MarkerPoseInCamera(info_.intrinsics, info_.room_markers.length_m, m, depth_m);
      if (!T_camera_marker) continue;
      known = map_.markers.emplace(m.id, MapMarker{keyframe.T_world_color * *T_camera_marker, 0, 1})
                  .first;
    }
    ++known->second.num_views;
  }
}

void Tracker::AdjustLocally(int index) {
  if (index == 0) return;
  BundleOptions bundle;
  bundle.marker_length_m = info_.room_markers.length_m;
  bundle.depth_noise = info_.depth_noise;
  // The joint solve ends what is begun here.
  bundle.max_iterations = 4;
  bundle.function_tolerance = 1e-3;
  bundle.min_corner_sigma_px = 0.3;
  for (int k = std::max(1, index + 1 - options_.local_keyframes); k <= index; ++k)
    if (IsConstrained(map_, map_.keyframe(k))) bundle.free_keyframes.push_back(k);
  CalibrationModel as_stated;
  BundleAdjust(info_.intrinsics, bundle, {}, map_, as_stated);
}

}  // namespace plumb
