// Finds the camera again after loss, by known markers or by descriptors.
#pragma once

#include <optional>
#include <vector>

#include "algo/tracking/keypoints.hpp"
#include "algo/tracking/map.hpp"

namespace plumb {

inline constexpr int kBeyondDoubt = 60;  ///< So many features that agree end a search.

struct Relocalization {
  Pose T_world_color = Pose::Identity();
  int keyframe = 0;     ///< The nearest keyframe, for tracking against.
  int num_inliers = 0;  ///< Corners or features that agree.
};

/// By the markers that the map knows: all their corners together; a lone marker only when depth
/// settles its two poses.
[[nodiscard]] std::optional<Relocalization> RelocalizeByMarkers(
    const TrackingMap& map, const Intrinsics& intrinsics, double marker_length_m,
    const std::vector<MarkerObservation>& markers, const cv::Mat& depth_m);

/// By ORB features with depth: nearest in Hamming distance in each keyframe, three-point rigid
/// fits, best consensus.
/// @param keyframes  Those to compare with, in this order; one that leaves no doubt ends the
/// search.
[[nodiscard]] std::optional<Relocalization> RelocalizeByFeatures(const TrackingMap& map,
                                                                 const Intrinsics& intrinsics,
                                                                 const DescribedFeatures& features,
                                                                 const std::vector<int>& keyframes);
/// The same with all keyframes of the map, the newest first.
[[nodiscard]] std::optional<Relocalization> RelocalizeByFeatures(const TrackingMap& map,
                                                                 const Intrinsics& intrinsics,
                                                                 const DescribedFeatures& features);

/// Pose of one marker in the camera frame from its four corners. A square has two candidate poses;
/// the depth inside it decides between them, or else a clear difference in reprojection error.
/// Returns nothing if neither decides.
[[nodiscard]] std::optional<Pose> MarkerPoseInCamera(const Intrinsics& intrinsics,
                                                     double marker_length_m,
                                                     const MarkerObservation& marker,
                                                     const cv::Mat& depth_m);

/// Index of the keyframe whose camera is nearest to a pose (metres plus 0.5 m a radian).
[[nodiscard]] int NearestKeyframe(const TrackingMap& map, const Pose& T_world_color);

}  // namespace plumb
