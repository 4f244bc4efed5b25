// SPDX-License-Identifier: Apache-2.0
// The tracker's map: keyframes, landmarks, markers. Its world frame is the first keyframe's colour
// camera.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/map/dense_view.hpp"
#include "algo/types/keyframe.hpp"

namespace plumb {

/// A natural keypoint in space.
struct Landmark {
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();
  int first_keyframe = 0;
  int num_observations = 0;  ///< Observations in keyframes.
  int num_rejections = 0;    ///< Number of poses for which it was an outlier.
  bool usable = true;
};

/// Observation of a landmark in a keyframe.
struct KeypointObservation {
  int landmark = 0;
  Eigen::Vector2d pixel;  ///< As observed (distorted).
  double z_m = 0.0;       ///< Depth at the pixel; 0 without depth or at an edge.
  /// Slope of the inverse depth around it, 1/m per pixel right and down.
  Eigen::Vector2d inverse_depth_slope = Eigen::Vector2d::Zero();
};

/// A keyframe of the map. `data.view.T_world_camera` (at depth time) follows T_world_color: see
/// DepthPose().
struct MapKeyframe {
  Keyframe data;
  Pose T_world_color = Pose::Identity();  ///< At the colour stamp.
  Vector6d velocity_per_s =
      Vector6d::Zero();  ///< Twist in the camera frame: T(t0 + dt) = T(t0) * PoseFromTwist(v dt).
  std::optional<int> previous;  ///< The keyframe against which it was tracked, if there was one.
  /// Its camera in the camera of `previous`, as tracked.
  Pose T_previous_color = Pose::Identity();
  std::vector<KeypointObservation> keypoints;
  DenseView dense;
  double median_depth_m = 1.0;  ///< Median of the dense view.
  cv::Mat gray;                 ///< CV_8UC1.
  bool is_bare = false;         ///< Its images were released, see BoundImages().
  /// For relocalisation, computed on demand: keypoints with a descriptor and depth.
  std::vector<Eigen::Vector2f> features_px;
  std::vector<Eigen::Vector3f> features_camera;  ///< The same in the camera frame, metres.
  cv::Mat descriptors;  ///< One ORB descriptor per row, for each of the features.
};

/// Camera pose `dt_s` after the colour stamp under the keyframe's velocity.
[[nodiscard]] inline Pose PoseAfter(const Pose& T_world_color, const Vector6d& velocity_per_s,
                                    double dt_s) {
  return T_world_color * PoseFromTwist(velocity_per_s * dt_s);
}

/// A marker of the map as a rigid square with a known side.
struct MapMarker {
  Pose T_world_marker = Pose::Identity();
  int num_views = 0;  ///< Keyframes that show it.
  /// Tracked frames, keyframes or not, that agree on all its corners, including the frame that
  /// started the map.
  int num_frames = 0;
};

struct TrackingMap {
  std::vector<MapKeyframe> keyframes;
  std::vector<Landmark> landmarks;
  std::map<int, MapMarker> markers;

  [[nodiscard]] MapKeyframe& keyframe(int k) { return keyframes[static_cast<std::size_t>(k)]; }
  [[nodiscard]] const MapKeyframe& keyframe(int k) const {
    return keyframes[static_cast<std::size_t>(k)];
  }
  [[nodiscard]] Landmark& landmark(int id) { return landmarks[static_cast<std::size_t>(id)]; }
  [[nodiscard]] const Landmark& landmark(int id) const {
    return landmarks[static_cast<std::size_t>(id)];
  }
};

/// Whether enough shared landmarks or a marker constrain the keyframe. If not (a blank wall),
/// bundle adjustment would let it slide, and its tracked pose is used as a constraint.
[[nodiscard]] inline bool IsConstrained(const TrackingMap& map, const MapKeyframe& keyframe) {
  constexpr int kEnough = 30;
  int shared = 0;
  for (const KeypointObservation& o : keyframe.keypoints) {
    const Landmark& landmark = map.landmark(o.landmark);
    shared += landmark.usable && landmark.num_observations > 1 ? 1 : 0;
  }
  if (shared >= kEnough) return true;
  for (const MarkerObservation& marker : keyframe.data.markers)
    if (map.markers.contains(marker.id)) return true;
  return false;
}

}  // namespace plumb
