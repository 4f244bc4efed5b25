// SPDX-License-Identifier: Apache-2.0
// Depth images averaged over square blocks of pixels: what live monitoring registers.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/sensor_model/depth_sensor.hpp"

namespace plumb {

/// About 160 x 120 blocks over a camera's image, whatever its size. Blocks are numbered row-major;
/// pixels right of the last column or below the last row belong to none.
struct BlockGrid {
  explicit BlockGrid(const Intrinsics& camera);

  Intrinsics intrinsics;
  int side = 4;  ///< Pixels.
  int columns = 0;
  int rows = 0;
  std::vector<Eigen::Vector2f> centre_ray;  ///< Ideal (x/z, y/z) of each block's centre.

  [[nodiscard]] std::size_t size() const { return centre_ray.size(); }
  /// Block that a point of the camera frame falls into; nothing outside or behind the camera.
  [[nodiscard]] std::optional<std::size_t> BlockOf(const Eigen::Vector3d& p_camera) const;

 private:
  bool has_lens_ = false;
};

/// One depth image by blocks.
struct BlockImage {
  /// 1 / metres, mean over the block's pixels (of a plane it is exact); 0 where less than half of
  /// the block was measured, or where it lies across an edge of depth.
  std::vector<float> inverse_depth;
  std::vector<Eigen::Vector2f> ray;  ///< Ideal (x/z, y/z) of the mean of the pixels measured.

  [[nodiscard]] Eigen::Vector3f Point(std::size_t block) const {
    return Eigen::Vector3f(ray[block].x(), ray[block].y(), 1.0F) / inverse_depth[block];
  }
};

/// @param depth_m  CV_32FC1 of the camera's size, metres, 0 where nothing was measured.
/// @throws std::invalid_argument for another type or size.
[[nodiscard]] BlockImage AverageBlocks(const cv::Mat& depth_m, const BlockGrid& grid,
                                       const UsableDepth& usable);

}  // namespace plumb
