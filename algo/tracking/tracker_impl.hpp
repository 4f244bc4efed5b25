// State of the tracker, for the sources that implement it: tracker.cpp finds the pose of a frame,
// tracker_keyframes.cpp keeps the map of keyframes.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "algo/markers/marker_detector.hpp"
#include "algo/tracking/dense_view.hpp"
#include "algo/tracking/followed_points.hpp"
#include "algo/tracking/keyframe_link.hpp"
#include "algo/tracking/keypoints.hpp"
#include "algo/tracking/pose_optimizer.hpp"
#include "algo/tracking/relocalizer.hpp"
#include "algo/tracking/tracker.hpp"

namespace plumb {

struct Tracker::Impl {
  // Data computed from one frame's images before its pose is known.
  struct FrameData {
    GrayImage image;
    DenseView dense;  // Used for the pose only.
    std::vector<MarkerObservation> markers;
    bool has_all_markers = false;  // False: only markers near expected positions were searched.
  };

  StreamInfo info;
  TrackerOptions options;
  DenseViewMaker dense_maker;
  std::optional<MarkerDetector> detector;

  TrackingMap map;
  std::vector<TrackedFrame> frames;

  Pyramid last_pyramid;
  FollowedPoints followed_points;
  std::optional<int> reference;     // Keyframe against which frames are tracked.
  std::size_t reference_count = 0;  // Active points when that keyframe was created.
  Pose T_world_last = Pose::Identity();
  double last_time_s = 0;
  Vector6d velocity = Vector6d::Zero();
  bool lost = true;
  bool keyframe_wanted = false;  // Set after a relocalisation.
  std::vector<KeyframeLink> loops;
  int num_unlike = 0;  // Consecutive keyframes that matched no older one.
  int loop_pause = 0;  // Keyframes left to skip before the next comparison with older ones.

  Impl(const StreamInfo& stream, const TrackerOptions& tracker_options);

  // A frame and its pose (tracker.cpp).
  FrameData Prepare(const Frame& frame) const;
  void FindMarkers(const Frame& frame, FrameData& prepared) const;
  void FindAllMarkers(FrameData& prepared) const;
  // Only where there is one.
  [[nodiscard]] const MapKeyframe& ReferenceKeyframe() const {
    return map.keyframes[static_cast<std::size_t>(reference.value())];
  }
  [[nodiscard]] Pose PredictedPose(const Frame& frame) const;
  TrackedFrame Track(const Frame& frame, bool fewer_keypoints);
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
};

}  // namespace plumb
