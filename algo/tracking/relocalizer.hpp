// SPDX-License-Identifier: Apache-2.0
// Finds the camera again after tracking was lost, by known markers or by descriptors.
#pragma once

#include <optional>
#include <vector>

#include "algo/map/map.hpp"
#include "algo/tracking/keypoints.hpp"

namespace plumb {

inline constexpr int kBeyondDoubt = 60;  ///< Number of agreeing features that ends a search.

struct Relocalization {
  Pose T_world_color = Pose::Identity();
  int keyframe = 0;     ///< The nearest keyframe, to track against.
  int num_inliers = 0;  ///< Corners or features that agree.
};

/// Uses all corners of the markers in the map together. A single marker is used only if depth
/// resolves its two possible poses.
[[nodiscard]] std::optional<Relocalization> RelocalizeByMarkers(
    const TrackingMap& map, const Intrinsics& intrinsics, double marker_length_m,
    const std::vector<MarkerObservation>& markers, const cv::Mat& depth_m);

/// Uses ORB features with depth: nearest neighbours in Hamming distance in each keyframe,
/// three-point rigid fits, best consensus.
/// @param keyframes  Keyframes to compare with, in this order; an unambiguous one ends the search.
[[nodiscard]] std::optional<Relocalization> RelocalizeByFeatures(const TrackingMap& map,
                                                                 const Intrinsics& intrinsics,
                                                                 const DescribedFeatures& features,
                                                                 const std::vector<int>& keyframes);

/// Pose of one marker in the camera frame from its four corners. A square has two candidate poses;
/// the depth on it decides between them, or a clear difference in reprojection error. Returns
/// nothing if neither decides.
[[nodiscard]] std::optional<Pose> MarkerPoseInCamera(const Intrinsics& intrinsics,
                                                     double marker_length_m,
                                                     const MarkerObservation& marker,
                                                     const cv::Mat& depth_m);

/// Index of the keyframe whose camera is nearest to a pose (metres plus 0.5 m per radian).
[[nodiscard]] int NearestKeyframe(const TrackingMap& map, const Pose& T_world_color);

}  // namespace plumb
