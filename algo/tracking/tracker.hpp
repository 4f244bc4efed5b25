// SPDX-License-Identifier: Apache-2.0
// Tracks the camera: one robust pose per frame from keypoints, marker corners and depth; keyframes,
// and relocalisation after loss.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "algo/map/dense_view.hpp"
#include "algo/map/keyframe_link.hpp"
#include "algo/map/map.hpp"
#include "algo/markers/marker_detector.hpp"
#include "algo/tracking/followed_points.hpp"
#include "algo/tracking/keypoints.hpp"
#include "algo/tracking/pose_optimizer.hpp"
#include "algo/tracking/relocalizer.hpp"
#include "algo/types/frame.hpp"

namespace plumb {

struct TrackerOptions {
  bool use_markers = true;
  bool use_keypoints = true;
  bool use_dense =
      true;  ///< Use depth against the last keyframe, so that few keypoints do not lose the pose.
  /// Translation since the last keyframe, as a fraction of the median depth, that creates a new
  /// one.
  double keyframe_distance = 0.06;
  double keyframe_angle_rad = 0.09;
  /// Fraction of the keyframe's keypoints below which a new keyframe is created.
  double min_tracked_fraction = 0.6;
  int local_keyframes = 6;  ///< Keyframes that local bundle adjustment moves.
  /// Keyframes keep colour, and depth once they are not the newest, at working resolution.
  bool keep_working_images = false;
  bool keep_color = true;  ///< Keyframes keep their colour images.
  /// Largest number of keyframes that keep images, see BoundImages().
  std::size_t max_images = 96;
};

/// Outcome of one frame.
struct TrackedFrame {
  std::int64_t frame_index = 0;
  double color_time_s = 0.0;
  double depth_time_s = 0.0;
  bool tracked = false;
  std::optional<int> keyframe;            ///< Index in the map if it became a keyframe.
  std::optional<int> reference_keyframe;  ///< The keyframe against which it was tracked, if it was.
  /// Colour camera at the colour stamp, in the reference keyframe's colour camera.
  Pose T_reference_color = Pose::Identity();
  /// If it became a keyframe: the one against which it was tracked. The first keyframe has none.
  std::optional<int> previous_keyframe;
  Pose T_previous_color =
      Pose::Identity();  ///< If it became a keyframe: its camera in that one's, as tracked.
  Vector6d velocity_per_s = Vector6d::Zero();  ///< In the camera frame.
  int num_keypoints = 0;
  bool fewer_keypoints = false;  ///< As in the frame.
  int num_markers = 0;
};

/// Median time between consecutive frames, in seconds: it is not affected by gaps.
/// @throws std::invalid_argument for fewer than two frames.
[[nodiscard]] double UsualSpacing(std::span<const TrackedFrame> frames);

/// Two stamps that are closer than this fraction of the usual spacing are not the times at which
/// the images were taken. The motion between them, divided by their difference, is not a velocity.
inline constexpr double kLeastOfUsualSpacing = 0.5;

/// Not thread-safe: call from one thread. Deterministic.
class Tracker {
 public:
  /// @param info  Intrinsics, depth noise, marker dictionary and marker length.
  /// @throws DataError if the dictionary is unknown or the depth noise impossible.
  Tracker(const StreamInfo& info, const TrackerOptions& options);
  Tracker(const Tracker&) = delete;  // The points refer to the map.
  Tracker& operator=(const Tracker&) = delete;

  /// The frame's images are shared by reference count and kept for keyframes.
  /// Frame::fewer_keypoints: from each keyframe on, only one keypoint in each larger cell is
  /// followed. The keyframe itself still observes all that were followed until then.
  TrackedFrame Track(const Frame& frame);

  [[nodiscard]] const TrackingMap& map() const { return map_; }
  /// The map, for refinement after the last frame.
  [[nodiscard]] TrackingMap TakeMap() { return std::move(map_); }
  [[nodiscard]] const std::vector<TrackedFrame>& frames() const { return frames_; }
  /// Live estimate of a tracked frame; the world is the first keyframe's colour camera.
  [[nodiscard]] Pose T_world_color(const TrackedFrame& frame) const;

 private:
  // Data computed from one frame's images before its pose is known.
  struct FrameData {
    GrayImage image;
    DenseView dense;  // Used for the pose only.
    std::vector<MarkerObservation> markers;
    bool has_all_markers = false;  // False: only markers near expected positions were searched.
  };

  // A frame and its pose (tracker.cpp).
  FrameData Prepare(const Frame& frame) const;
  void FindMarkers(const Frame& frame, FrameData& prepared) const;
  void FindAllMarkers(FrameData& prepared) const;
  // Only where there is one.
  [[nodiscard]] const MapKeyframe& ReferenceKeyframe() const {
    return map_.keyframe(reference_.value());
  }
  [[nodiscard]] Pose PredictedPose(const Frame& frame) const;
  static bool ShowsSomething(const FrameData& prepared);
  [[nodiscard]] double SigmaPx() const;
  void AddMarkerPoints(const std::vector<MarkerObservation>& markers,
                       std::vector<PosePoint>& points) const;
  PoseProblem MakeProblem(const FrameData& prepared, double dt_depth_s) const;
  static Pose DepthPose(const MapKeyframe& keyframe);
  [[nodiscard]] double PlausibleStep_s(double step_s) const;
  [[nodiscard]] bool Plausible(const PoseEstimate& estimate, std::size_t num_points,
                               double dt_s) const;
  std::optional<PoseEstimate> FollowFrame(const Frame& frame, const FrameData& prepared,
                                          TrackedFrame& result);
  int CountMarkers(const std::vector<MarkerObservation>& markers, const PoseEstimate& estimate);
  std::optional<PoseEstimate> Relocalize(const Frame& frame, FrameData& prepared,
                                         TrackedFrame& result);
  void Accept(const Frame& frame, FrameData& prepared, const PoseEstimate& estimate,
              TrackedFrame& result);
  void RefreshKeyframeVelocity(const Frame& frame, const Pose& T_world_now);

  // Keyframes and loops (tracker_keyframes.cpp).
  [[nodiscard]] bool NeedsKeyframe(const Pose& T_world_color) const;
  [[nodiscard]] std::vector<std::size_t> KeyframesNear(const Pose& T_world_color,
                                                       std::size_t count) const;
  void MakeKeyframe(const Frame& frame, FrameData& prepared, const Pose& T_world_color,
                    TrackedFrame& result);
  void Describe(int index);
  std::optional<Relocalization> FindAmongKeyframes(const DescribedFeatures& features);
  void CloseLoop(const FrameData& prepared, int index);
  std::optional<Pose> EstimatePoseFromKeyframe(int older, const Pose& T_world_guess,
                                               const FrameData& prepared,
                                               const MapKeyframe& newest);
  void AssociateKeyframe(const FrameData& prepared, const cv::Mat& depth_m,
                         const Pose& T_world_color, MapKeyframe& keyframe);
  void AddNewMarkers(const cv::Mat& depth_m, const MapKeyframe& keyframe);
  void AdjustLocally(int index);

  StreamInfo info_;
  TrackerOptions options_;
  DenseViewMaker dense_maker_;
  std::optional<MarkerDetector> detector_;

  TrackingMap map_;
  std::vector<TrackedFrame> frames_;

  Pyramid last_pyramid_;
  FollowedPoints followed_points_;
  std::optional<int> reference_;     // Keyframe against which frames are tracked.
  std::size_t reference_count_ = 0;  // Active points when that keyframe was created.
  Pose T_world_last_ = Pose::Identity();
  double last_time_s_ = 0;
  Vector6d velocity_ = Vector6d::Zero();
  bool lost_ = true;
  bool keyframe_wanted_ = false;  // Set after a relocalisation.
  std::vector<KeyframeLink> loops_;
  int num_unlike_ = 0;  // Consecutive keyframes that matched no older one.
  int loop_pause_ = 0;  // Keyframes left to skip before the next comparison with older ones.
};

}  // namespace plumb
