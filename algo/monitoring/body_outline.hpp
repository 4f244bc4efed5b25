// SPDX-License-Identifier: Apache-2.0
// Where a scanned body would be seen in a camera's image, to lie down as it lay.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/markers/marker_detector.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/point_cloud.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// Lines of points as shares of the image's width and height, longest first: open ones where the
/// body leaves the image, else ending where they begin. At most kMostOutlinePoints in all.
using OutlineLines = std::vector<std::vector<Eigen::Vector2f>>;
inline constexpr std::size_t kMostOutlinePoints = 400;

/// The silhouette of a surface; empty if it is not in the image.
[[nodiscard]] OutlineLines OutlineOf(const TriangleMesh& body, const Pose& T_camera_mesh,
                                     const Intrinsics& camera);

/// Finds that of one scene's body in single images. Not thread-safe.
class BodyOutline {
 public:
  /// @param dictionary  Of the room's markers; a planning CT names none.
  /// @param markers  Of the room, in the scene's frame.
  /// @throws DataError if the scene has no height map or no body, or for an unknown dictionary.
  BodyOutline(const Scene& scene, const std::string& dictionary, MarkerMap markers);

  /// Nothing where the markers do not say where the camera is, see PlaceByMarkers().
  /// @param color  CV_8UC3 of the camera's size.
  [[nodiscard]] std::optional<OutlineLines> In(const cv::Mat& color,
                                               const Intrinsics& camera) const;

 private:
  MarkerMap markers_;
  MarkerDetector detector_;
  TriangleMesh body_;
};

}  // namespace plumb
