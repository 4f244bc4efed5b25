#include "algo/tracking/tracker.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "algo/markers/marker_detector.hpp"
#include "algo/tracking/followed_points.hpp"
#include "algo/tracking/image_budget.hpp"
#include "algo/tracking/keypoints.hpp"
#include "algo/tracking/local_bundle.hpp"
#include "algo/tracking/loop_closer.hpp"
#include "algo/tracking/pose_optimizer.hpp"
#include "algo/tracking/relocalizer.hpp"

namespace plumb {
namespace {

// Largest plausible speed of a hand-held sensor, metres per second.
constexpr double kMaxSpeed = 2.5;
constexpr double kMaxTurn = 4.0;  // Radians per second.
constexpr std::size_t kReassociated =
    3;  // Older keyframes whose landmarks are searched in a new keyframe.
// Drift up to which bundle adjustment corrects the map without loop closure, once the old landmarks
// are observed again.
constexpr double kDriftFollowed_m = 0.003;
constexpr double kDriftFollowed_rad = 0.001;
// Keyframes not compared after one that matched no older keyframe: a scene in view stays for
// several keyframes, and a comparison costs as much as tracking a frame.
constexpr int kLongestLoopPause = 2;
constexpr int kLoopInliers =
    30;  // Features, and keypoints after them, that must agree to recognise a place.

// Data computed from one frame's images before its pose is known.
struct FrameData {
  GrayImage image;
  DenseView dense;  // Used for the pose only.
  std::vector<MarkerObservation> markers;
  bool has_all_markers = false;  // False: only markers near their expected positions were searched.
};

// Median of a view's usable cells, metres; 1 without any.
double MedianDepth(const DenseView& view) {
  std::vector<float> z;
  for (const float value : view.z_m)
    if (value > 0) z.push_back(value);
  if (z.empty()) return 1.0;
  std::nth_element(z.begin(), z.begin() + static_cast<std::ptrdiff_t>(z.size() / 2), z.end());
  return z[z.size() / 2];
}

cv::Mat MiddlesOfBlocks(const cv::Mat& rgb, int block) {
  if (block == 1) return rgb;
  cv::Mat middles(rgb.rows / block, rgb.cols / block, CV_8UC3);
  for (int r = 0; r < middles.rows; ++r) {
    const auto* from = rgb.ptr<cv::Vec3b>(r * block + block / 2) + block / 2;
    auto* to = middles.ptr<cv::Vec3b>(r);
    for (int c = 0; c < middles.cols; ++c) to[c] = from[c * block];
  }
  return middles;
}

}  // namespace

struct Tracker::Impl {
  StreamInfo info;
  TrackerOptions options;
  DenseViewMaker dense_maker;
  std::optional<MarkerDetector> detector;

  TrackingMap map;
  std::vector<TrackedFrame> frames;

  Pyramid last_pyramid;
  FollowedPoints followed_points;
  int reference = -1;               // Keyframe against which frames are tracked.
  std::size_t reference_count = 0;  // Active points when that keyframe was created.
  Pose T_world_last = Pose::Identity();
  double last_time_s = 0;
  Vector6d velocity = Vector6d::Zero();
  bool lost = true;
  bool keyframe_wanted = false;  // Set after a relocalisation.
  std::vector<KeyframeLink> loops;
  int num_unlike = 0;  // Consecutive keyframes that matched no older one.
  int loop_pause = 0;  // Keyframes left to skip before the next comparison with older ones.

  Impl(const StreamInfo& stream, const TrackerOptions& tracker_options)
      : info(stream),
        options(tracker_options),
        dense_maker(stream.intrinsics),
        followed_points(stream.intrinsics, map) {
    if (options.use_markers) detector.emplace(MarkerDictionary::ByName(info.marker_dictionary));
  }

  // ---- one frame
  // -------------------------------------------------------------------------------------------------

  FrameData Prepare(const Frame& frame) const {
    const Intrinsics& k = info.intrinsics;
    for (const cv::Mat* image : {&frame.color_rgb, &frame.depth_m})
      if (image->cols != k.width || image->rows != k.height)
        throw std::invalid_argument(
            fmt::format("frame {}: image is {}x{}, the intrinsics are for {}x{}", frame.index,
                        image->cols, image->rows, k.width, k.height));
    FrameData prepared;
    cv::cvtColor(frame.color_rgb, prepared.image.gray, cv::COLOR_RGB2GRAY);
    prepared.image.pyramid = followed_points.PyramidOf(prepared.image.gray);
    prepared.dense = dense_maker.MakeForPose(frame.depth_m);
    FindMarkers(frame, prepared);
    return prepared;
  }

  // While tracking, only markers of the map take part in the pose, and their approximate positions
  // are known. New ones are searched in keyframes.
  void FindMarkers(const Frame& frame, FrameData& prepared) const {
    if (!detector) return;
    if (lost || map.keyframes.empty() || NeedsKeyframe(PredictedPose(frame))) {
      FindAllMarkers(prepared);
      return;
    }
    const Pose T_camera_world = PredictedPose(frame).inverse();
    const MarkerCorners in_marker = CornersInMarkerFrame(info.marker_length_m);
    std::vector<ImageCorners> expected;
    for (const auto& [id, marker] : map.markers) {
      const Pose T_camera_marker = T_camera_world * marker.T_world_marker;
      ImageCorners corners;
      bool in_front = true;
      for (std::size_t i = 0; i < 4; ++i) {
        const Eigen::Vector3d p = T_camera_marker * in_marker[i];
        in_front = in_front && p.z() > 0.1;
        if (in_front) corners[i] = Project(info.intrinsics, p);
      }
      if (in_front) expected.push_back(corners);
    }
    prepared.markers = detector->DetectNear(prepared.image.gray, expected).markers;
  }

  void FindAllMarkers(FrameData& prepared) const {
    if (!detector || prepared.has_all_markers) return;
    prepared.markers = detector->Detect(prepared.image.gray).markers;
    prepared.has_all_markers = true;
  }

  // Predicted with the velocity of the last frame.
  [[nodiscard]] Pose PredictedPose(const Frame& frame) const {
    return PoseAfter(T_world_last, velocity, std::min(frame.color_time_s - last_time_s, 0.3));
  }

  TrackedFrame Track(const Frame& frame) {
    FrameData prepared = Prepare(frame);
    TrackedFrame result;
    result.frame_index = frame.index;
    result.color_time_s = frame.color_time_s;
    result.depth_time_s = frame.depth_time_s;
    if (map.keyframes.empty()) {
      // A map that starts with an empty image could never be found again.
      if (ShowsSomething(prepared)) {
        MakeKeyframe(frame, prepared, Pose::Identity(), result);
        result.tracked = true;
      }
    } else {
      std::optional<PoseEstimate> estimate;
      if (!lost) estimate = FollowFrame(frame, prepared, result);
      if (!estimate) estimate = Relocalize(frame, prepared, result);
      if (estimate) {
        Accept(frame, prepared, *estimate, result);
      } else {
        lost = true;
        followed_points.SetPoints({});
      }
    }
    last_pyramid = std::move(prepared.image.pyramid);
    frames.push_back(result);
    return result;
  }

  static bool ShowsSomething(const FrameData& prepared) {
    return !prepared.markers.empty() ||
           std::any_of(prepared.dense.z_m.begin(), prepared.dense.z_m.end(),
                       [](float z) { return z > 0; });
  }

  // ---- pose
  // ------------------------------------------------------------------------------------------------------

  [[nodiscard]] double SigmaPx() const { return info.intrinsics.width / 640.0; }

  void AddMarkerPoints(const std::vector<MarkerObservation>& markers,
                       std::vector<PosePoint>& points) const {
    const MarkerCorners in_marker = CornersInMarkerFrame(info.marker_length_m);
    for (const MarkerObservation& m : markers) {
      const auto known = map.markers.find(m.id);
      if (known == map.markers.end()) continue;
      for (std::size_t i = 0; i < 4; ++i) {
        PosePoint point;
        point.p_world = known->second.T_world_marker * in_marker[i];
        point.ideal = Undistort(info.intrinsics, m.corners[i]);
        // Half a pixel for the error of the map and the rolling shutter, in addition to the
        // detector's.
        point.sigma = std::hypot(m.sigma_px[i], 0.5 * SigmaPx()) / info.intrinsics.fx;
        points.push_back(point);
      }
    }
  }

  PoseProblem MakeProblem(const FrameData& prepared, double dt_depth_s) const {
    PoseProblem problem;
    problem.intrinsics = info.intrinsics;
    problem.T_color_depth = PoseFromTwist(velocity * dt_depth_s);
    if (options.use_dense) {
      const MapKeyframe& keyframe = map.keyframes[static_cast<std::size_t>(reference)];
      problem.dense_frame = &prepared.dense;
      problem.dense_target = &keyframe.dense;
      problem.T_world_target = DepthPose(keyframe);
    }
    return problem;
  }

  static Pose DepthPose(const MapKeyframe& keyframe) {
    return PoseAfter(keyframe.T_world_color, keyframe.velocity_per_s,
                     keyframe.data.depth_time_s - keyframe.data.color_time_s);
  }

  // True if the estimate is reliable: enough inliers, all six directions constrained, and a
  // plausible speed for a hand.
  [[nodiscard]] bool Plausible(const PoseEstimate& estimate, std::size_t num_points,
                               double dt_s) const {
    const double share =
        num_points > 0 ? static_cast<double>(estimate.num_inliers) / static_cast<double>(num_points)
                       : 0.0;
    const bool by_points = estimate.num_inliers >= 12 && share > 0.35;
    const bool by_markers = num_points > 0 && estimate.num_inliers >= 4 && share > 0.6;
    const bool by_depth =
        estimate.num_dense > 600 && estimate.dense_overlap > 0.4 && estimate.dense_rms_m < 0.012;
    if (!by_points && !by_markers && !by_depth) return false;
    // Depth that contradicts a pose from few points: the start was wrong.
    if (!by_points && estimate.num_dense > 0 && estimate.dense_overlap < 0.25) return false;
    const Matrix6d covariance = estimate.information.ldlt().solve(Matrix6d::Identity());
    const double rotation_rad = std::sqrt(std::max(0.0, covariance.topLeftCorner<3, 3>().trace()));
    const double translation_m =
        std::sqrt(std::max(0.0, covariance.bottomRightCorner<3, 3>().trace()));
    if (!(rotation_rad < 0.02) || !(translation_m < 0.02)) return false;
    const Pose T_last_now = T_world_last.inverse() * estimate.T_world_camera;
    const double dt = std::clamp(dt_s, 0.02, 1.0);
    return lost || (T_last_now.translation().norm() < kMaxSpeed * dt + 0.02 &&
                    RotationAngle(T_last_now) < kMaxTurn * dt + 0.03);
  }

  std::optional<PoseEstimate> FollowFrame(const Frame& frame, const FrameData& prepared,
                                          TrackedFrame& result) {
    const double dt = frame.color_time_s - last_time_s;
    const double dt_depth = frame.depth_time_s - frame.color_time_s;
    // Starts from constant velocity; if that fails (a jerk), from the last pose.
    const std::array<Pose, 2> guesses = {PredictedPose(frame), T_world_last};
    for (const Pose& T_guess : guesses) {
      PoseProblem problem = MakeProblem(prepared, dt_depth);
      AddMarkerPoints(prepared.markers, problem.points);
      const std::size_t num_corners = problem.points.size();
      std::vector<ActivePoint> followed;
      if (options.use_keypoints)
        followed_points.Follow(last_pyramid, prepared.image, frame.depth_m, T_guess, followed,
                               problem.points);
      PoseEstimate estimate = OptimizePose(problem, T_guess);
      if (!Plausible(estimate, problem.points.size(), dt)) continue;
      std::vector<ActivePoint> agreeing;
      for (std::size_t i = 0; i < followed.size(); ++i) {
        Landmark& landmark = map.landmarks[static_cast<std::size_t>(followed[i].landmark)];
        if (estimate.inlier[num_corners + i]) {
          agreeing.push_back(followed[i]);
        } else if (++landmark.num_rejections > 3 && landmark.num_observations < 3) {
          landmark.usable = false;
        }
      }
      followed_points.SetPoints(std::move(agreeing));
      result.num_keypoints = static_cast<int>(followed_points.points().size());
      result.num_markers = CountMarkers(prepared.markers, estimate);
      return estimate;
    }
    return std::nullopt;
  }

  // Marks the markers whose corners all agree with the pose. Their points come first in the
  // estimate, as AddMarkerPoints() adds them.
  int CountMarkers(const std::vector<MarkerObservation>& markers, const PoseEstimate& estimate) {
    int count = 0;
    std::size_t i = 0;
    for (const MarkerObservation& m : markers) {
      const auto known = map.markers.find(m.id);
      if (known == map.markers.end()) continue;
      if (estimate.inlier[i] && estimate.inlier[i + 1] && estimate.inlier[i + 2] &&
          estimate.inlier[i + 3]) {
        ++known->second.num_frames;
        ++count;
      }
      i += 4;
    }
    return count;
  }

  std::optional<PoseEstimate> Relocalize(const Frame& frame, FrameData& prepared,
                                         TrackedFrame& result) {
    lost = true;
    velocity.setZero();
    FindAllMarkers(prepared);
    std::optional<Relocalization> found = RelocalizeByMarkers(
        map, info.intrinsics, info.marker_length_m, prepared.markers, frame.depth_m);
    std::optional<DescribedFeatures> features;
    for (int attempt = 0; attempt < 2; ++attempt) {
      if (!found && options.use_keypoints && !features) {
        features = DescribeFeatures(prepared.image.gray, frame.depth_m, info.intrinsics);
        found = FindAmongKeyframes(*features);
      }
      if (!found) return std::nullopt;
      reference = found->keyframe;
      PoseProblem problem = MakeProblem(prepared, 0.0);
      AddMarkerPoints(prepared.markers, problem.points);
      followed_points.SetPoints({});
      followed_points.Reassociate(prepared.image, frame.depth_m, found->T_world_color,
                                  KeyframesNear(found->T_world_color, map.keyframes.size()),
                                  problem.points);
      PoseEstimate estimate = OptimizePose(problem, found->T_world_color);
      if (Plausible(estimate, problem.points.size(), 1.0)) {
        result.num_markers = CountMarkers(prepared.markers, estimate);
        result.num_keypoints = static_cast<int>(followed_points.points().size());
        keyframe_wanted = true;
        return estimate;
      }
      found.reset();
    }
    followed_points.SetPoints({});
    return std::nullopt;
  }

  void Accept(const Frame& frame, FrameData& prepared, const PoseEstimate& estimate,
              TrackedFrame& result) {
    const double dt = frame.color_time_s - last_time_s;
    if (!lost && dt > 0)
      velocity = TwistFromPose(T_world_last.inverse() * estimate.T_world_camera) / dt;
    result.tracked = true;
    result.velocity_per_s = velocity;
    RefreshKeyframeVelocity(frame, estimate.T_world_camera);
    lost = false;
    T_world_last = estimate.T_world_camera;
    last_time_s = frame.color_time_s;
    if (keyframe_wanted || NeedsKeyframe(estimate.T_world_camera)) {
      MakeKeyframe(frame, prepared, estimate.T_world_camera, result);
    } else {
      result.reference_keyframe = reference;
      result.T_reference_color =
          map.keyframes[static_cast<std::size_t>(reference)].T_world_color.inverse() *
          estimate.T_world_camera;
    }
  }

  // The frame after a keyframe gives that keyframe a velocity by central differences.
  void RefreshKeyframeVelocity(const Frame& frame, const Pose& T_world_now) {
    if (frames.empty() || frames.back().keyframe < 0 || lost) return;
    MapKeyframe& keyframe = map.keyframes[static_cast<std::size_t>(frames.back().keyframe)];
    const double dt_after = frame.color_time_s - keyframe.data.color_time_s;
    if (dt_after <= 0) return;
    const Vector6d after = TwistFromPose(keyframe.T_world_color.inverse() * T_world_now) / dt_after;
    keyframe.velocity_per_s =
        frames.back().keyframe == 0 ? after : Vector6d(0.5 * (keyframe.velocity_per_s + after));
    frames.back().velocity_per_s = keyframe.velocity_per_s;
  }

  // ---- keyframes
  // -------------------------------------------------------------------------------------------------

  [[nodiscard]] bool NeedsKeyframe(const Pose& T_world_color) const {
    const MapKeyframe& keyframe = map.keyframes[static_cast<std::size_t>(reference)];
    const Pose T_keyframe_now = keyframe.T_world_color.inverse() * T_world_color;
    if (T_keyframe_now.translation().norm() >
        options.keyframe_distance * std::clamp(keyframe.median_depth_m, 0.4, 3.0))
      return true;
    if (RotationAngle(T_keyframe_now) > options.keyframe_angle_rad) return true;
    return options.use_keypoints &&
           static_cast<double>(followed_points.points().size()) <
               options.min_tracked_share * static_cast<double>(reference_count) &&
           (T_keyframe_now.translation().norm() > 0.01 || RotationAngle(T_keyframe_now) > 0.01 ||
            followed_points.points().size() < 30);
  }

  // The nearest by pose of the first `count` keyframes with a similar view. The reference is
  // excluded while it is being tracked.
  [[nodiscard]] std::vector<std::size_t> KeyframesNear(const Pose& T_world_color,
                                                       std::size_t count) const {
    std::vector<std::pair<double, std::size_t>> near;
    for (std::size_t k = 0; k < count; ++k) {
      if (!lost && static_cast<int>(k) == reference) continue;
      if (map.keyframes[k].gray.empty()) continue;
      const Pose T = map.keyframes[k].T_world_color.inverse() * T_world_color;
      const double depth = std::clamp(map.keyframes[k].median_depth_m, 0.4, 3.0);
      const double distance = T.translation().norm() / depth + RotationAngle(T);
      if (distance < 0.7) near.emplace_back(distance, k);
    }
    std::sort(near.begin(), near.end());
    std::vector<std::size_t> result;
    for (std::size_t i = 0; i < std::min(kReassociated, near.size()); ++i)
      result.push_back(near[i].second);
    return result;
  }

  void MakeKeyframe(const Frame& frame, FrameData& prepared, const Pose& T_world_color,
                    TrackedFrame& result) {
    FindAllMarkers(prepared);
    MapKeyframe keyframe;
    keyframe.data.frame_index = frame.index;
    keyframe.data.color_time_s = frame.color_time_s;
    keyframe.data.depth_time_s = frame.depth_time_s;
    keyframe.data.view.intrinsics = info.intrinsics;
    keyframe.data.view.depth_m = frame.depth_m;
    if (options.keep_color)
      keyframe.data.view.color_rgb = MiddlesOfBlocks(frame.color_rgb, options.color_block);
    keyframe.data.markers = prepared.markers;
    keyframe.T_world_color = T_world_color;
    keyframe.velocity_per_s = velocity;
    keyframe.dense = dense_maker.Make(frame.depth_m);
    keyframe.median_depth_m = MedianDepth(keyframe.dense);
    keyframe.gray = prepared.image.gray;
    const int index = static_cast<int>(map.keyframes.size());
    if (options.use_keypoints) {
      AssociateKeyframe(prepared, frame.depth_m, T_world_color, keyframe);
      followed_points.AddCorners(prepared.image, frame.depth_m, index, keyframe);
      followed_points.KeepPyramid(static_cast<std::size_t>(index), prepared.image.pyramid);
    }
    AddNewMarkers(frame.depth_m, keyframe);
    if (reference >= 0) {
      result.previous_keyframe = reference;
      result.T_previous_color =
          map.keyframes[static_cast<std::size_t>(reference)].T_world_color.inverse() *
          T_world_color;
    }
    keyframe.previous = reference;
    keyframe.T_previous_color = result.T_previous_color;
    map.keyframes.push_back(std::move(keyframe));
    reference = index;
    keyframe_wanted = false;
    lost = false;
    AdjustLocally(index);
    if (options.use_keypoints) CloseLoop(prepared, index);
    BoundImages(options.max_images, map);
    reference_count = followed_points.points().size();
    const Pose T_adjusted = map.keyframes.back().T_world_color;
    T_world_last = T_adjusted;
    last_time_s = frame.color_time_s;
    result.keyframe = index;
    result.reference_keyframe = index;
    result.T_reference_color = Pose::Identity();
  }

  // Features cost as much as tracking a frame, and most keyframes are never compared by them.
  void Describe(int index) {
    MapKeyframe& keyframe = map.keyframes[static_cast<std::size_t>(index)];
    if (!keyframe.descriptors.empty() || keyframe.gray.empty()) return;
    DescribedFeatures features =
        DescribeFeatures(keyframe.gray, keyframe.data.view.depth_m, info.intrinsics);
    keyframe.features_px = std::move(features.pixels);
    keyframe.features_camera = std::move(features.in_camera);
    keyframe.descriptors = features.descriptors;
  }

  // Compares the features of all keyframes, the newest first, and describes them only as far as
  // needed.
  std::optional<Relocalization> FindAmongKeyframes(const DescribedFeatures& features) {
    std::optional<Relocalization> best;
    for (int k = static_cast<int>(map.keyframes.size()) - 1; k >= 0; --k) {
      Describe(k);
      const auto found = RelocalizeByFeatures(map, info.intrinsics, features, {k});
      if (!found || (best && found->num_inliers <= best->num_inliers)) continue;
      best = found;
      if (best->num_inliers >= kBeyondDoubt) break;
    }
    return best;
  }

  // Loop closure at a place seen long ago: if the map has drifted since, the loop error is
  // distributed, and the old landmarks are tracked again.
  void CloseLoop(const FrameData& prepared, int index) {
    if (loop_pause > 0) {
      --loop_pause;
      return;
    }
    const std::vector<int> candidates = LoopCandidates(map);
    if (candidates.empty()) return;
    for (const int k : candidates) Describe(k);
    Describe(index);
    const MapKeyframe& newest = map.keyframes.back();
    const auto found = RelocalizeByFeatures(
        map, info.intrinsics, {newest.features_px, newest.features_camera, newest.descriptors},
        candidates);
    num_unlike = found ? 0 : num_unlike + 1;
    loop_pause = std::min(num_unlike, kLongestLoopPause);
    if (!found || found->num_inliers < kLoopInliers) return;
    const std::optional<Pose> T_world_seen =
        EstimatePoseFromKeyframe(found->keyframe, found->T_world_color, prepared, newest);
    if (!T_world_seen) return;
    const Pose T_drift = newest.T_world_color.inverse() * *T_world_seen;
    const DriftBound bound = LargestDrift(map, found->keyframe);
    if (T_drift.translation().norm() > bound.translation_m ||
        RotationAngle(T_drift) > bound.rotation_rad)
      return;
    if (T_drift.translation().norm() > kDriftFollowed_m ||
        RotationAngle(T_drift) > kDriftFollowed_rad) {
      const Pose& T_world_old =
          map.keyframes[static_cast<std::size_t>(found->keyframe)].T_world_color;
      loops.push_back({found->keyframe, index, T_world_old.inverse() * *T_world_seen});
      DistributeLoopError(loops, map);
    }

    MapKeyframe& keyframe = map.keyframes.back();
    const std::size_t known = followed_points.points().size();
    std::vector<PosePoint> points;
    followed_points.Reassociate(prepared.image, keyframe.data.view.depth_m, keyframe.T_world_color,
                                KeyframesNear(keyframe.T_world_color, map.keyframes.size()),
                                points);
    followed_points.Observe(points, known, keyframe);
    AdjustLocally(index);
  }

  // Pose of the newest keyframe from an older keyframe's neighbourhood alone (landmarks and depth).
  // Nothing if they do not agree well.
  std::optional<Pose> EstimatePoseFromKeyframe(int older, const Pose& T_world_guess,
                                               const FrameData& prepared,
                                               const MapKeyframe& newest) {
    const std::vector<ActivePoint> followed = followed_points.points();
    followed_points.SetPoints({});
    const int followed_reference = std::exchange(reference, older);
    PoseProblem problem =
        MakeProblem(prepared, newest.data.depth_time_s - newest.data.color_time_s);
    reference = -1;  // No landmark is left.
    followed_points.Reassociate(prepared.image, newest.data.view.depth_m, T_world_guess,
                                KeyframesNear(T_world_guess, static_cast<std::size_t>(older) + 4),
                                problem.points);
    const PoseEstimate estimate = OptimizePose(problem, T_world_guess);
    followed_points.SetPoints(followed);
    reference = followed_reference;
    const bool by_depth =
        !options.use_dense || (estimate.num_dense > 300 && estimate.dense_rms_m < 0.015);
    if (estimate.num_inliers < kLoopInliers ||
        2 * estimate.num_inliers < static_cast<int>(problem.points.size()) || !by_depth)
      return std::nullopt;
    return estimate.T_world_camera;
  }

  // Observations in a new keyframe: tracked landmarks and rediscovered landmarks of older
  // keyframes.
  void AssociateKeyframe(const FrameData& prepared, const cv::Mat& depth_m,
                         const Pose& T_world_color, MapKeyframe& keyframe) {
    const std::size_t followed = followed_points.points().size();
    std::vector<PosePoint> found;
    followed_points.Reassociate(prepared.image, depth_m, T_world_color,
                                KeyframesNear(T_world_color, map.keyframes.size()), found);
    for (std::size_t i = 0; i < followed; ++i)
      followed_points.AddObservation(followed_points.points()[i], keyframe);
    followed_points.Observe(found, followed, keyframe);
  }

  void AddNewMarkers(const cv::Mat& depth_m, const MapKeyframe& keyframe) {
    for (const MarkerObservation& m : keyframe.data.markers) {
      auto known = map.markers.find(m.id);
      if (known == map.markers.end()) {
        const auto T_camera_marker =
            MarkerPoseInCamera(info.intrinsics, info.marker_length_m, m, depth_m);
        if (!T_camera_marker) continue;
        known =
            map.markers.emplace(m.id, MapMarker{keyframe.T_world_color * *T_camera_marker, 0, 1})
                .first;
      }
      ++known->second.num_views;
    }
  }

  void AdjustLocally(int index) {
    if (index == 0) return;
    LocalBundleOptions bundle;
    bundle.marker_length_m = info.marker_length_m;
    for (int k = std::max(1, index + 1 - options.local_keyframes); k <= index; ++k)
      if (IsConstrained(map, map.keyframes[static_cast<std::size_t>(k)]))
        bundle.free_keyframes.push_back(k);
    AdjustLocalMap(info.intrinsics, bundle, map);
  }
};

Tracker::Tracker(const StreamInfo& info, const TrackerOptions& options)
    : impl_(std::make_unique<Impl>(info, options)) {}
Tracker::~Tracker() = default;
TrackedFrame Tracker::Track(const Frame& frame) { return impl_->Track(frame); }
const TrackingMap& Tracker::map() const { return impl_->map; }
TrackingMap Tracker::TakeMap() { return std::move(impl_->map); }
const std::vector<TrackedFrame>& Tracker::frames() const { return impl_->frames; }
Pose Tracker::T_world_color(const TrackedFrame& frame) const {
  return impl_->map.keyframes.at(static_cast<std::size_t>(frame.reference_keyframe)).T_world_color *
         frame.T_reference_color;
}

}  // namespace plumb
