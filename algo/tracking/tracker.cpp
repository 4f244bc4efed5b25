// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/tracker.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/statistics.hpp"
#include "algo/tracking/surface_agreement.hpp"
#include "algo/tracking/view_geometry.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

// Fastest plausible motion of a hand-held sensor, and what a pose may be off besides. Measured: up
// to 0.8 m/s and 0.5 rad/s in a sweep of sim-a, 0.5 m/s and 2.7 rad/s where somebody turned a
// Kinect about all axes on purpose.
constexpr double kMaxSpeed = 2.5;  // Metres per second.
constexpr double kMaxTurn = 4.0;   // Radians per second.
constexpr double kJump_m = 0.02;
constexpr double kJump_rad = 0.03;
// Two images are at least and at most this far apart in time for that bound.
constexpr double kShortestStep_s = 0.02;
constexpr double kLongestStep_s = 1.0;
// The last frame's velocity is believed no longer than this.
constexpr double kPrediction_s = 0.3;

// Points that hold a pose: many of which a part agrees, or few of which most agree; one marker
// gives four. Measured: in a sweep of sim-a at least 157 points and 67 % of them agree with a right
// pose; after the sensor had been covered, and on the Kinect, 7 to 16 and 5 to 7 % do in one frame
// of twenty. All numbers from kMaxSpeed to kEstablishedBy made laxer at once, by a factor of two,
// and all but those two of landmarks made stricter (fractions 0.5 to 0.8), give the same bits on
// that covered sweep. On the Kinect, with half a second cut out, laxer ones make the path's error
// 9.3 instead of 7.0 mm; with the sensor covered, stricter ones lose four images of 54 and make it
// 10.7 instead of 7.6 mm.
constexpr int kManyPoints = 12;
constexpr double kPartOfMany = 0.35;
constexpr int kFewPoints = 4;
constexpr double kPartOfFew = 0.6;
// Fraction of the frame's cells that lie on the keyframe's surface: enough to hold a pose without
// points, and too few to be believed with few points. Measured: 84 to 95 % in a sweep of sim-a, 67
// to 83 % on the Kinect; 7 % of a covered sensor's first image where it was wrong.
constexpr double kHoldingOverlap = 0.4;
constexpr double kContradictingOverlap = 0.25;
// Standard deviations of a pose above which a direction counts as unconstrained. Measured: at most
// 2.5 mrad and 2.1 mm, so that this rejects only poses without any hold.
constexpr double kMaxSigma_rad = 0.02;
constexpr double kMaxSigma_m = 0.02;
// A landmark rejected more often than this, and seen by fewer keyframes than that, is given up.
constexpr int kMaxRejections = 3;
constexpr int kEstablishedBy = 3;
// The error of the map and of the rolling shutter at a marker's corner, beside the detector's.
constexpr double kCornerInMap_px = 0.5;

// How keypoints and marker corners agree with a pose.
struct PointSupport {
  bool by_many = false;     // Enough keypoints or corners in any case.
  bool by_markers = false;  // Few, but most of them.
  [[nodiscard]] bool is_enough() const { return by_many || by_markers; }
};

PointSupport SupportOf(const PoseEstimate& estimate, std::size_t num_points) {
  if (num_points == 0) return {};
  const double fraction =
      static_cast<double>(estimate.num_inliers) / static_cast<double>(num_points);
  return {.by_many = estimate.num_inliers >= kManyPoints && fraction > kPartOfMany,
          .by_markers = estimate.num_inliers >= kFewPoints && fraction > kPartOfFew};
}

}  // namespace

double UsualSpacing(std::span<const TrackedFrame> frames) {
  std::vector<double> spacings_s;
  for (std::size_t i = 1; i < frames.size(); ++i)
    spacings_s.push_back(frames[i].color_time_s - frames[i - 1].color_time_s);
  return TakeMedian(spacings_s);
}

Tracker::Tracker(const StreamInfo& info, const TrackerOptions& options)
    : info_(info),
      options_(options),
      dense_maker_(info.intrinsics),
      followed_points_(info.intrinsics, info.depth_noise, map_) {
  if (const std::optional<Message> fault = FaultOf(info_.depth_noise))
    throw DataError(say::sensor::NoiseUnusable(*fault));
  if (options_.use_markers)
    detector_.emplace(MarkerDictionary::ByName(info_.room_markers.dictionary));
}

Tracker::FrameData Tracker::Prepare(const Frame& frame) const {
  const Intrinsics& k = info_.intrinsics;
  for (const cv::Mat* image : {&frame.color_rgb, &frame.depth_m})
    if (image->cols != k.width || image->rows != k.height)
      throw std::invalid_argument(
          fmt::format("frame {}: image is {}x{}, the intrinsics are for {}x{}", frame.index,
                      image->cols, image->rows, k.width, k.height));
  FrameData prepared;
  cv::cvtColor(frame.color_rgb, prepared.image.gray, cv::COLOR_RGB2GRAY);
  prepared.image.pyramid = followed_points_.PyramidOf(prepared.image.gray);
  prepared.dense = dense_maker_.MakeForPose(frame.depth_m);
  FindMarkers(frame, prepared);
  return prepared;
}

// While tracking, only markers of the map take part in the pose, and their approximate positions
// are known. New ones are searched in keyframes.
void Tracker::FindMarkers(const Frame& frame, FrameData& prepared) const {
  if (!detector_) return;
  if (lost_ || map_.keyframes.empty() || NeedsKeyframe(PredictedPose(frame))) {
    FindAllMarkers(prepared);
    return;
  }
  const Pose T_camera_world = PredictedPose(frame).inverse();
  const MarkerCorners in_marker = CornersInMarkerFrame(info_.room_markers.length_m);
  std::vector<ImageCorners> expected;
  for (const auto& [id, marker] : map_.markers) {
    const Pose T_camera_marker = T_camera_world * marker.T_world_marker;
    ImageCorners corners;
    bool in_front = true;
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector3d p = T_camera_marker * in_marker[i];
      in_front = in_front && p.z() > kNearestInView_m;
      if (in_front) corners[i] = Project(info_.intrinsics, p);
    }
    if (in_front) expected.push_back(corners);
  }
  prepared.markers = detector_->DetectNear(prepared.image.gray, expected).markers;
}

void Tracker::FindAllMarkers(FrameData& prepared) const {
  if (!detector_ || prepared.has_all_markers) return;
  prepared.markers = detector_->Detect(prepared.image.gray).markers;
  prepared.has_all_markers = true;
}

// Predicted with the velocity of the last frame.
Pose Tracker::PredictedPose(const Frame& frame) const {
  return PoseAfter(T_world_last_, velocity_,
                   std::min(frame.color_time_s - last_time_s_, kPrediction_s));
}

TrackedFrame Tracker::Track(const Frame& frame) {
  FrameData prepared = Prepare(frame);
  TrackedFrame result;
  result.frame_index = frame.index;
  result.color_time_s = frame.color_time_s;
  result.depth_time_s = frame.depth_time_s;
  result.fewer_keypoints = frame.fewer_keypoints;
  if (map_.keyframes.empty()) {
    // A map that starts with an empty image could never be found again.
    if (ShowsSomething(prepared)) {
      MakeKeyframe(frame, prepared, Pose::Identity(), result);
      result.tracked = true;
    }
  } else {
    std::optional<PoseEstimate> estimate;
    if (!lost_) estimate = FollowFrame(frame, prepared, result);
    if (!estimate) estimate = Relocalize(frame, prepared, result);
    if (estimate) {
      Accept(frame, prepared, *estimate, result);
    } else {
      lost_ = true;
      followed_points_.SetPoints({});
    }
  }
  last_pyramid_ = std::move(prepared.image.pyramid);
  frames_.push_back(result);
  return result;
}

bool Tracker::ShowsSomething(const FrameData& prepared) {
  return !prepared.markers.empty() ||
         std::any_of(prepared.dense.z_m.begin(), prepared.dense.z_m.end(),
                     [](float z) { return z > 0; });
}

double Tracker::SigmaPx() const { return info_.intrinsics.width / 640.0; }

void Tracker::AddMarkerPoints(const std::vector<MarkerObservation>& markers,
                              std::vector<PosePoint>& points) const {
  const MarkerCorners in_marker = CornersInMarkerFrame(info_.room_markers.length_m);
  for (const MarkerObservation& m : markers) {
    const auto known = map_.markers.find(m.id);
    if (known == map_.markers.end()) continue;
    for (std::size_t i = 0; i < 4; ++i) {
      PosePoint point;
      point.p_world = known->second.T_world_marker * in_marker[i];
      point.ideal = Undistort(info_.intrinsics, m.corners[i]);
      point.sigma = std::hypot(m.sigma_px[i], kCornerInMap_px * SigmaPx()) / info_.intrinsics.fx;
      points.push_back(point);
    }
  }
}

PoseProblem Tracker::MakeProblem(const FrameData& prepared, double dt_depth_s) const {
  PoseProblem problem;
  problem.intrinsics = info_.intrinsics;
  problem.depth_noise = info_.depth_noise;
  problem.T_color_depth = PoseFromTwist(velocity_ * dt_depth_s);
  if (options_.use_dense) {
    const MapKeyframe& keyframe = ReferenceKeyframe();
    problem.dense_frame = &prepared.dense;
    problem.dense_target = &keyframe.dense;
    problem.T_world_target = DepthPose(keyframe);
  }
  return problem;
}

Pose Tracker::DepthPose(const MapKeyframe& keyframe) {
  return PoseAfter(keyframe.T_world_color, keyframe.velocity_per_s,
                   keyframe.data.depth_time_s - keyframe.data.color_time_s);
}

// The time since an earlier image, but at least half of the usual spacing. If stamps are made on
// arrival, two images may be stamped within a millisecond, and dividing their motion by that would
// give an absurd velocity.
double Tracker::PlausibleStep_s(double step_s) const {
  constexpr std::size_t kRecent = 16, kLeast = 4;
  if (frames_.size() < kLeast) return step_s;
  const std::span<const TrackedFrame> recent =
      std::span(frames_).last(std::min(kRecent, frames_.size()));
  return std::max(step_s, kLeastOfUsualSpacing * UsualSpacing(recent));
}

// True if the estimate is reliable: enough inliers, all six directions constrained, and a
// plausible speed for a hand.
bool Tracker::Plausible(const PoseEstimate& estimate, std::size_t num_points, double dt_s) const {
  const PointSupport support = SupportOf(estimate, num_points);
  const bool by_depth = SurfacesAgree(estimate) && estimate.dense_overlap > kHoldingOverlap;
  if (!support.is_enough() && !by_depth) return false;
  // Depth that contradicts a pose from few points: the start was wrong.
  if (!support.by_many && estimate.num_dense > 0 && estimate.dense_overlap < kContradictingOverlap)
    return false;
  const Matrix6d covariance = estimate.information.ldlt().solve(Matrix6d::Identity());
  const double rotation_rad = std::sqrt(std::max(0.0, covariance.topLeftCorner<3, 3>().trace()));
  const double translation_m =
      std::sqrt(std::max(0.0, covariance.bottomRightCorner<3, 3>().trace()));
  if (!(rotation_rad < kMaxSigma_rad) || !(translation_m < kMaxSigma_m)) return false;
  const Pose T_last_now = T_world_last_.inverse() * estimate.T_world_camera;
  const double dt = std::clamp(dt_s, kShortestStep_s, kLongestStep_s);
  return lost_ || (T_last_now.translation().norm() < kMaxSpeed * dt + kJump_m &&
                   RotationAngle(T_last_now) < kMaxTurn * dt + kJump_rad);
}

std::optional<PoseEstimate> Tracker::FollowFrame(const Frame& frame, const FrameData& prepared,
                                                 TrackedFrame& result) {
  const double dt = PlausibleStep_s(frame.color_time_s - last_time_s_);
  const double dt_depth = frame.depth_time_s - frame.color_time_s;
  struct Attempt {
    PoseEstimate estimate;
    std::vector<ActivePoint> followed;
    std::size_t num_corners = 0;
  };
  std::optional<Attempt> best;
  // Starts from constant velocity; if that fails (a jerk), from the last pose. Depth alone
  // can also fit at a wrong pose, so it decides only if neither start finds the points.
  const std::array<Pose, 2> guesses = {PredictedPose(frame), T_world_last_};
  for (const Pose& T_guess : guesses) {
    Attempt attempt;
    PoseProblem problem = MakeProblem(prepared, dt_depth);
    AddMarkerPoints(prepared.markers, problem.points);
    attempt.num_corners = problem.points.size();
    if (options_.use_keypoints)
      followed_points_.Follow(last_pyramid_, prepared.image, frame.depth_m, T_guess,
                              attempt.followed, problem.points);
    attempt.estimate = OptimizePose(problem, T_guess);
    if (!Plausible(attempt.estimate, problem.points.size(), dt)) continue;
    const bool is_supported = SupportOf(attempt.estimate, problem.points.size()).is_enough();
    if (is_supported || !best) best = std::move(attempt);
    if (is_supported) break;
  }
  if (!best) return std::nullopt;
  std::vector<ActivePoint> agreeing;
  for (std::size_t i = 0; i < best->followed.size(); ++i) {
    Landmark& landmark = map_.landmark(best->followed[i].landmark);
    if (best->estimate.inlier[best->num_corners + i]) {
      agreeing.push_back(best->followed[i]);
    } else if (++landmark.num_rejections > kMaxRejections &&
               landmark.num_observations < kEstablishedBy) {
      landmark.usable = false;
    }
  }
  followed_points_.SetPoints(std::move(agreeing));
  result.num_keypoints = static_cast<int>(followed_points_.points().size());
  result.num_markers = CountMarkers(prepared.markers, best->estimate);
  return std::move(best->estimate);
}

// Marks the markers whose corners all agree with the pose. Their points come first in the
// estimate, as AddMarkerPoints() adds them.
int Tracker::CountMarkers(const std::vector<MarkerObservation>& markers,
                          const PoseEstimate& estimate) {
  int count = 0;
  std::size_t i = 0;
  for (const MarkerObservation& m : markers) {
    const auto known = map_.markers.find(m.id);
    if (known == map_.markers.end()) continue;
    if (estimate.inlier[i] && estimate.inlier[i + 1] && estimate.inlier[i + 2] &&
        estimate.inlier[i + 3]) {
      ++known->second.num_frames;
      ++count;
    }
    i += 4;
  }
  return count;
}

std::optional<PoseEstimate> Tracker::Relocalize(const Frame& frame, FrameData& prepared,
                                                TrackedFrame& result) {
  lost_ = true;
  velocity_.setZero();
  FindAllMarkers(prepared);
  std::optional<Relocalization> found = RelocalizeByMarkers(
      map_, info_.intrinsics, info_.room_markers.length_m, prepared.markers, frame.depth_m);
  std::optional<DescribedFeatures> features;
  for (int attempt = 0; attempt < 2; ++attempt) {
    if (!found && options_.use_keypoints && !features) {
      features = DescribeFeatures(prepared.image.gray, frame.depth_m, info_.intrinsics);
      found = FindAmongKeyframes(*features);
    }
    if (!found) return std::nullopt;
    reference_ = found->keyframe;
    PoseProblem problem = MakeProblem(prepared, 0.0);
    AddMarkerPoints(prepared.markers, problem.points);
    followed_points_.SetPoints({});
    followed_points_.Reassociate(prepared.image, frame.depth_m, found->T_world_color,
                                 KeyframesNear(found->T_world_color, map_.keyframes.size()),
                                 problem.points);
    PoseEstimate estimate = OptimizePose(problem, found->T_world_color);
    if (Plausible(estimate, problem.points.size(), kLongestStep_s)) {
      result.num_markers = CountMarkers(prepared.markers, estimate);
      result.num_keypoints = static_cast<int>(followed_points_.points().size());
      keyframe_wanted_ = true;
      return estimate;
    }
    found.reset();
  }
  followed_points_.SetPoints({});
  return std::nullopt;
}

void Tracker::Accept(const Frame& frame, FrameData& prepared, const PoseEstimate& estimate,
                     TrackedFrame& result) {
  const double dt = PlausibleStep_s(frame.color_time_s - last_time_s_);
  if (!lost_ && dt > 0)
    velocity_ = TwistFromPose(T_world_last_.inverse() * estimate.T_world_camera) / dt;
  result.tracked = true;
  result.velocity_per_s = velocity_;
  RefreshKeyframeVelocity(frame, estimate.T_world_camera);
  lost_ = false;
  T_world_last_ = estimate.T_world_camera;
  last_time_s_ = frame.color_time_s;
  if (keyframe_wanted_ || NeedsKeyframe(estimate.T_world_camera)) {
    MakeKeyframe(frame, prepared, estimate.T_world_camera, result);
  } else {
    result.reference_keyframe = reference_;
    result.T_reference_color =
        ReferenceKeyframe().T_world_color.inverse() * estimate.T_world_camera;
  }
}

// The frame after a keyframe gives that keyframe a velocity by central differences.
void Tracker::RefreshKeyframeVelocity(const Frame& frame, const Pose& T_world_now) {
  if (frames_.empty() || lost_) return;
  const std::optional<int> last = frames_.back().keyframe;
  if (!last) return;
  MapKeyframe& keyframe = map_.keyframe(*last);
  const double dt_after = PlausibleStep_s(frame.color_time_s - keyframe.data.color_time_s);
  if (dt_after <= 0) return;
  const Vector6d after = TwistFromPose(keyframe.T_world_color.inverse() * T_world_now) / dt_after;
  keyframe.velocity_per_s = *last == 0 ? after : Vector6d(0.5 * (keyframe.velocity_per_s + after));
  frames_.back().velocity_per_s = keyframe.velocity_per_s;
}

Pose Tracker::T_world_color(const TrackedFrame& frame) const {
  const auto keyframe = static_cast<std::size_t>(frame.reference_keyframe.value());
  return map_.keyframes.at(keyframe).T_world_color * frame.T_reference_color;
}

}  // namespace plumb
