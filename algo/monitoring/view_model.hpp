// SPDX-License-Identifier: Apache-2.0
// A scene's surface as a sensor at rest sees it, rendered once: a frame then needs no search.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/pose.hpp"
#include "algo/monitoring/block_image.hpp"
#include "algo/sensor_model/depth_noise.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// What a block shows.
enum class SurfacePart : std::uint8_t { kNone, kRegion, kSupport, kOther };

/// One plane for each block, in the scene frame.
struct ViewModel {
  std::vector<Eigen::Vector3f> point;
  std::vector<Eigen::Vector3f> normal;  ///< Unit length, towards the sensor.
  std::vector<float> inverse_depth;     ///< As the sensor sees the point; 0 for kNone.
  std::vector<float> sigma_m;           ///< Of one measurement there, along the normal.
  std::vector<SurfacePart> part;

  [[nodiscard]] std::size_t CountOf(SurfacePart wanted) const;
};

/// Depth image of a mesh, CV_32FC1, 0 where there is none. Of several surfaces the nearest counts.
[[nodiscard]] cv::Mat RenderDepth(const TriangleMesh& mesh, const Pose& T_camera_mesh,
                                  const Intrinsics& camera);

/// Planes through the blocks of a depth image; kNone where neighbours give no normal, or where the
/// surface is seen at more than 76 deg.
/// @param part_of  What a point of the scene belongs to; not kNone.
[[nodiscard]] ViewModel MakeViewModel(
    const BlockImage& seen, const BlockGrid& grid, const Pose& T_scene_camera,
    const DepthNoise& noise, const std::function<SurfacePart(const Eigen::Vector3d&)>& part_of);

}  // namespace plumb
