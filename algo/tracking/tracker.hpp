// Tracks the camera: one robust pose per frame from keypoints, marker corners and depth; keyframes,
// and relocalisation after loss.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "algo/tracking/map.hpp"
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
  double min_tracked_share = 0.6;
  int local_keyframes = 6;  ///< Keyframes that local bundle adjustment moves.
  /// Of each block of so many pixels each way, keyframes keep the colour of the middle one.
  int color_block = 1;
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
  bool fewer_keypoints = false;  ///< As passed to Track().
  int num_markers = 0;
};

/// Median time between consecutive frames, in seconds: it is not affected by gaps.
/// @throws std::invalid_argument for fewer than two frames.
[[nodiscard]] double UsualSpacing(std::span<const TrackedFrame> frames);

/// Two stamps that are closer than this share of the usual spacing are not the times at which the
/// images were taken. The motion between them, divided by their difference, is not a velocity.
inline constexpr double kLeastOfUsualSpacing = 0.5;

/// Not thread-safe: call from one thread. Deterministic.
class Tracker {
 public:
  /// @param info  Intrinsics, depth noise, marker dictionary and marker length.
  /// @throws DataError if the dictionary is unknown or the depth noise impossible.
  Tracker(const StreamInfo& info, const TrackerOptions& options);
  ~Tracker();

  /// The frame's images are shared by reference count and kept for keyframes.
  /// @param fewer_keypoints  For a computer that is too slow: from each keyframe on, only one
  ///         keypoint in each larger cell is followed. The keyframe itself still observes all that
  ///         were followed until then.
  TrackedFrame Track(const Frame& frame, bool fewer_keypoints = false);

  [[nodiscard]] const TrackingMap& map() const;
  /// The map, for refinement after the last frame.
  [[nodiscard]] TrackingMap TakeMap();
  [[nodiscard]] const std::vector<TrackedFrame>& frames() const;
  /// Live estimate of a tracked frame; the world is the first keyframe's colour camera.
  [[nodiscard]] Pose T_world_color(const TrackedFrame& frame) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
