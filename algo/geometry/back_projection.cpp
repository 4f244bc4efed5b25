// SPDX-License-Identifier: Apache-2.0
#include "algo/geometry/back_projection.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

namespace plumb {
namespace {

constexpr int kMaxSide = 16384;

/// Undistort() for neighbouring pixels: starting from the neighbour's offset, a few iterations
/// reach single precision. Each one reduces the residual by the lens's local gradient (below 0.2
/// for consumer lenses).
Eigen::Vector2d UndistortFrom(const Intrinsics& intrinsics, const Eigen::Vector2d& distorted,
                              const Eigen::Vector2d& start) {
  Eigen::Vector2d ideal = start;
  for (int round = 0; round < 12; ++round) {
    const Eigen::Vector2d step = distorted - DistortNormalised(intrinsics, ideal);
    ideal += step;
    if (step.squaredNorm() < 1e-18) break;
  }
  return ideal;
}

}  // namespace

RayTable::RayTable(const Intrinsics& intrinsics) : intrinsics_(intrinsics) {
  if (intrinsics.width < 1 || intrinsics.width > kMaxSide || intrinsics.height < 1 ||
      intrinsics.height > kMaxSide)
    throw std::invalid_argument(fmt::format("ray table: image size {}x{} outside 1..{}",
                                            intrinsics.width, intrinsics.height, kMaxSide));
  if (!(intrinsics.fx > 0 && intrinsics.fy > 0 && std::isfinite(intrinsics.fx) &&
        std::isfinite(intrinsics.fy)))
    throw std::invalid_argument(fmt::format("ray table: focal lengths {}, {} are not positive",
                                            intrinsics.fx, intrinsics.fy));
  const std::size_t width = static_cast<std::size_t>(intrinsics.width);
  ideal_.resize(width * static_cast<std::size_t>(intrinsics.height));
  const bool has_lens = HasLens(intrinsics);
  tbb::parallel_for(0, intrinsics.height, [&](int row) {
    Eigen::Vector2d offset =
        Eigen::Vector2d::Zero();  // ideal minus distorted, for the pixel to the left
    for (int column = 0; column < intrinsics.width; ++column) {
      const Eigen::Vector2d distorted((column - intrinsics.cx) / intrinsics.fx,
                                      (row - intrinsics.cy) / intrinsics.fy);
      Eigen::Vector2d ideal = distorted;
      if (has_lens) {
        ideal = column == 0 ? Undistort(intrinsics, Eigen::Vector2d(column, row))
                            : UndistortFrom(intrinsics, distorted, distorted + offset);
        offset = ideal - distorted;
      }
      ideal_[static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column)] =
          ideal.cast<float>();
    }
  });
}

std::shared_ptr<const RayTable> RayTables::For(const Intrinsics& intrinsics) {
  for (const auto& table : tables_)
    if (table->intrinsics() == intrinsics) return table;
  return tables_.emplace_back(std::make_shared<const RayTable>(intrinsics));
}

PointCloud BackProject(const DepthView& view, const RayTable& rays) {
  const cv::Mat& depth = view.depth_m;
  if (depth.type() != CV_32FC1 || depth.cols != rays.width() || depth.rows != rays.height())
    throw std::invalid_argument(
        fmt::format("back-projection: depth image {}x{} (type {}) does not fit a camera of {}x{}",
                    depth.cols, depth.rows, depth.type(), rays.width(), rays.height()));
  const bool has_color = !view.color_rgb.empty();
  if (has_color && (view.color_rgb.type() != CV_8UC3 || view.color_rgb.size() != depth.size()))
    throw std::invalid_argument(
        "back-projection: the colour image is not 8-bit RGB of the depth image's size");
  PointCloud cloud;
  std::size_t num_valid = 0;
  for (int row = 0; row < depth.rows; ++row) {
    const float* z = depth.ptr<float>(row);
    for (int column = 0; column < depth.cols; ++column) num_valid += z[column] > 0.0F ? 1 : 0;
  }
  cloud.points.reserve(num_valid);
  if (has_color) cloud.colors.reserve(num_valid);
  for (int row = 0; row < depth.rows; ++row) {
    const float* z = depth.ptr<float>(row);
    const Eigen::Vector2f* ideal = rays.row(row);
    for (int column = 0; column < depth.cols; ++column) {
      if (!(z[column] > 0.0F)) continue;
      cloud.points.emplace_back(ideal[column].x() * z[column], ideal[column].y() * z[column],
                                z[column]);
      if (has_color) {
        const cv::Vec3b& rgb = view.color_rgb.at<cv::Vec3b>(row, column);
        cloud.colors.push_back({rgb[0], rgb[1], rgb[2]});
      }
    }
  }
  return cloud;
}

}  // namespace plumb
