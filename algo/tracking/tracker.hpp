// Follows the camera: keypoints, marker corners and depth in one robust pose a frame, keyframes,
// and recovery after loss.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "algo/tracking/map.hpp"
#include "algo/types/frame.hpp"

namespace plumb {

struct TrackerOptions {
  bool use_markers = true;
  bool use_keypoints = true;
  bool use_dense =
      true;  ///< Depth against the last keyframe, so that few keypoints do not lose the pose.
  double keyframe_distance =
      0.06;  ///< Of the median depth: translation since the last keyframe that makes a new one.
  double keyframe_angle_rad = 0.09;
  double min_tracked_share = 0.6;  ///< Of the keyframe's keypoints; fewer make a new keyframe.
  int local_keyframes = 6;         ///< Keyframes that local bundle adjustment moves.
  bool keep_color = true;          ///< Keyframes keep their colour images.
  std::size_t max_images = 96;     ///< Keyframes that keep images at most, see BoundImages(); a
                                   ///< sweep of 300 frames has about 50.
};

/// A frame's outcome.
struct TrackedFrame {
  std::int64_t frame_index = 0;
  double color_time_s = 0.0;
  double depth_time_s = 0.0;
  bool tracked = false;
  int keyframe = -1;                          ///< Index in the map if it became one, else -1.
  int reference_keyframe = -1;                ///< The keyframe that it was tracked against.
  Pose T_reference_color = Pose::Identity();  ///< Colour camera at the colour stamp, in the
                                              ///< reference keyframe's colour camera.
  int previous_keyframe = -1;  ///< Of a keyframe: the one that it was tracked against, or -1.
  Pose T_previous_color =
      Pose::Identity();  ///< Of a keyframe: its camera in that one's, as tracked.
  Vector6d velocity_per_s = Vector6d::Zero();  ///< In the camera frame.
  int num_keypoints = 0;
  int num_markers = 0;
};

/// One thread calls. Deterministic.
class Tracker {
 public:
  /// @param info  Intrinsics, marker dictionary (DataError if unknown) and length.
  Tracker(const StreamInfo& info, const TrackerOptions& options);
  ~Tracker();

  /// The frame's images are borrowed by reference count and kept for keyframes.
  TrackedFrame Track(const Frame& frame);

  [[nodiscard]] const TrackingMap& map() const;
  /// The map, to be refined after the last frame.
  [[nodiscard]] TrackingMap TakeMap();
  [[nodiscard]] const std::vector<TrackedFrame>& frames() const;
  /// Live estimate, world = first keyframe's colour camera.
  [[nodiscard]] Pose T_world_color(const TrackedFrame& frame) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
