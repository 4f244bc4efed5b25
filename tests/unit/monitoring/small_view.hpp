// SPDX-License-Identifier: Apache-2.0
// A bumpy surface before a small camera, for tests of what looks at it.
#pragma once

#include <cmath>
#include <functional>
#include <vector>

#include "algo/base/pose.hpp"
#include "algo/monitoring/block_image.hpp"
#include "algo/monitoring/view_model.hpp"
#include "algo/sensor_model/depth_noise.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb::test {

inline Intrinsics SmallCamera() {
  Intrinsics camera;
  camera.width = 320;
  camera.height = 240;
  camera.fx = camera.fy = 290.0;
  camera.cx = 159.5;
  camera.cy = 119.5;
  return camera;
}

/// Height above z = 0 in the scene frame, metres.
inline double Bumps(double x, double y) {
  return 0.05 * std::cos(9.0 * x + 0.5) * std::cos(11.0 * y) + 0.03 * std::sin(17.0 * x - 6.0 * y);
}

/// @param moved  Applied to the surface.
/// @param rise   Added to its height, metres.
inline TriangleMesh BumpyMesh(const Pose& moved = Pose::Identity(),
                              const std::function<double(double, double)>& rise = {}) {
  constexpr int kSize = 241;
  TriangleMesh mesh;
  for (int row = 0; row < kSize; ++row) {
    for (int column = 0; column < kSize; ++column) {
      const double x = -0.3 + 0.0025 * column, y = -0.3 + 0.0025 * row;
      const double z = Bumps(x, y) + (rise ? rise(x, y) : 0.0);
      mesh.vertices.push_back((moved * Eigen::Vector3d(x, y, z)).cast<float>());
      if (row == 0 || column == 0) continue;
      const auto at = static_cast<std::uint32_t>(row * kSize + column);
      mesh.triangles.push_back({at, at - 1, at - kSize});
      mesh.triangles.push_back({at - 1, at - kSize - 1, at - kSize});
    }
  }
  return mesh;
}

/// One metre above the surface, looking down.
inline Pose CameraOfScene() {
  Pose T_camera_scene = Pose::Identity();
  T_camera_scene.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  T_camera_scene.translation() = Eigen::Vector3d(0.02, -0.01, 1.0);
  return T_camera_scene;
}

inline BlockImage Seen(const TriangleMesh& mesh, const BlockGrid& grid) {
  return AverageBlocks(RenderDepth(mesh, CameraOfScene(), grid.intrinsics), grid, UsableDepth{});
}

inline ViewModel ModelOf(const BlockImage& seen, const BlockGrid& grid) {
  return MakeViewModel(
      seen, grid, CameraOfScene().inverse(), DepthNoise{}, [](const Eigen::Vector3d& p) {
        return p.head<2>().norm() < 0.25 ? SurfacePart::kRegion : SurfacePart::kSupport;
      });
}

}  // namespace plumb::test
