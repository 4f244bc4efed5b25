// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/block_image.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace plumb {
namespace {

constexpr int kColumnsWanted = 160;
// Larger differences of depth within a block are an edge: a surface of 75 deg at 1 m has 26 mm.
constexpr float kEdge_m = 0.05F;

struct BlockSum {
  float inverse = 0.0F, u = 0.0F, v = 0.0F;
  float nearest = 1e9F, farthest = 0.0F;
  int count = 0;
};

void AddRow(const float* depth, int v, const BlockGrid& grid, const UsableDepth& usable,
            std::vector<BlockSum>& sums) {
  const auto nearest = static_cast<float>(usable.nearest_m);
  const auto farthest = static_cast<float>(usable.farthest_m);
  for (int column = 0; column < grid.columns; ++column) {
    BlockSum& sum = sums[static_cast<std::size_t>(column)];
    for (int u = 0; u < grid.side; ++u) {
      const float z = depth[column * grid.side + u];
      if (!(z >= nearest && z <= farthest)) continue;
      sum.inverse += 1.0F / z;
      sum.u += static_cast<float>(u);
      sum.v += static_cast<float>(v);
      sum.nearest = std::min(sum.nearest, z);
      sum.farthest = std::max(sum.farthest, z);
      ++sum.count;
    }
  }
}

}  // namespace

BlockGrid::BlockGrid(const Intrinsics& camera) : intrinsics(camera) {
  side = std::max(1, static_cast<int>(std::lround(camera.width / double{kColumnsWanted})));
  columns = camera.width / side;
  rows = camera.height / side;
  has_lens_ = HasLens(camera);
  const double middle = 0.5 * (side - 1);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column)
      centre_ray.push_back(
          Undistort(camera, {column * side + middle, row * side + middle}).cast<float>());
  }
}

std::optional<std::size_t> BlockGrid::BlockOf(const Eigen::Vector3d& p_camera) const {
  if (!(p_camera.z() > 0.05)) return std::nullopt;
  Eigen::Vector2d seen = p_camera.head<2>() / p_camera.z();
  if (has_lens_) seen = DistortNormalised(intrinsics, seen);
  const double u = (intrinsics.fx * seen.x() + intrinsics.cx + 0.5) / side;
  const double v = (intrinsics.fy * seen.y() + intrinsics.cy + 0.5) / side;
  if (!(u >= 0 && v >= 0 && u < columns && v < rows)) return std::nullopt;
  return static_cast<std::size_t>(v) * static_cast<std::size_t>(columns) +
         static_cast<std::size_t>(u);
}

BlockImage AverageBlocks(const cv::Mat& depth_m, const BlockGrid& grid, const UsableDepth& usable) {
  if (depth_m.type() != CV_32FC1 || depth_m.cols != grid.intrinsics.width ||
      depth_m.rows != grid.intrinsics.height)
    throw std::invalid_argument("monitoring: the depth image is not the camera's");
  BlockImage image{.inverse_depth = std::vector<float>(grid.size(), 0.0F), .ray = grid.centre_ray};
  const float middle = 0.5F * static_cast<float>(grid.side - 1);
  const auto fx = static_cast<float>(grid.intrinsics.fx);
  const auto fy = static_cast<float>(grid.intrinsics.fy);
  std::vector<BlockSum> sums;
  for (int row = 0; row < grid.rows; ++row) {
    sums.assign(static_cast<std::size_t>(grid.columns), {});
    for (int v = 0; v < grid.side; ++v)
      AddRow(depth_m.ptr<float>(row * grid.side + v), v, grid, usable, sums);
    for (std::size_t column = 0; column < sums.size(); ++column) {
      const BlockSum& sum = sums[column];
      if (2 * sum.count < grid.side * grid.side || sum.count == 0 ||
          sum.farthest - sum.nearest > kEdge_m)
        continue;
      const std::size_t block =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.columns) + column;
      const auto count = static_cast<float>(sum.count);
      image.inverse_depth[block] = sum.inverse / count;
      image.ray[block] +=
          Eigen::Vector2f((sum.u / count - middle) / fx, (sum.v / count - middle) / fy);
    }
  }
  return image;
}

}  // namespace plumb
