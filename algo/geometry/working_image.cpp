// SPDX-License-Identifier: Apache-2.0
#include "algo/geometry/working_image.hpp"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>
#include <opencv2/core.hpp>

namespace plumb {
namespace {

constexpr int kWorkingWidth = 320;  // Number of columns from which the block size is chosen.
// Tangent of 80 deg: steeper steps between neighbours are edges, not surfaces.
constexpr float kEdgeSlope = 6.0F;
constexpr float kEdgeSigmas = 4.0F;  // Additional margin for noise.

// Depth of one block, see WorkingDepth().
float DepthOfBlock(const cv::Mat& depth_m, int first_row, int first_column, int block,
                   const DepthNoise& noise, float pixel_rad) {
  float sum = 0.0F;
  float nearest = 0.0F;
  float farthest = 0.0F;
  int count = 0;
  for (int row = first_row; row < first_row + block; ++row) {
    const float* z = depth_m.ptr<float>(row) + first_column;
    for (int k = 0; k < block; ++k) {
      if (!(z[k] > 0.0F)) continue;
      sum += 1.0F / z[k];
      nearest = count == 0 ? z[k] : std::min(nearest, z[k]);
      farthest = std::max(farthest, z[k]);
      ++count;
    }
  }
  if (4 * count < 3 * block * block) return 0.0F;
  if (farthest - nearest > EdgeStep_m(noise, nearest, pixel_rad)) return 0.0F;
  return static_cast<float>(count) / sum;
}

// Whether it is a working image already.
bool IsWorking(const cv::Mat& pixels, int type, const Intrinsics& image,
               const Intrinsics& working) {
  const bool is_working = pixels.cols == working.width && pixels.rows == working.height;
  if (pixels.type() != type ||
      (!is_working && (pixels.cols != image.width || pixels.rows != image.height)))
    throw std::invalid_argument(
        fmt::format("working image: {}x{} (type {}) does not fit a camera of {}x{} (type {})",
                    pixels.cols, pixels.rows, pixels.type(), image.width, image.height, type));
  return is_working;
}

}  // namespace

int WorkingBlock(const Intrinsics& image) {
  const int block = std::max(1, (image.width + kWorkingWidth / 2) / kWorkingWidth);
  if (image.width < block || image.height < block)
    throw std::invalid_argument(
        fmt::format("working image: image size {}x{}", image.width, image.height));
  return block;
}

Intrinsics WorkingIntrinsics(const Intrinsics& image) {
  const int block = WorkingBlock(image);
  // Resized() is exact for the part of the image that whole blocks cover.
  Intrinsics covered = image;
  covered.width -= image.width % block;
  covered.height -= image.height % block;
  return Resized(covered, covered.width / block, covered.height / block);
}

float EdgeStep_m(const DepthNoise& noise, float depth_m, float pixel_rad) {
  return kEdgeSlope * depth_m * pixel_rad + kEdgeSigmas * noise.SigmaFacing_m(depth_m);
}

cv::Mat WorkingDepth(const cv::Mat& depth_m, const Intrinsics& image, const DepthNoise& noise) {
  const Intrinsics working = WorkingIntrinsics(image);
  if (IsWorking(depth_m, CV_32FC1, image, working)) return depth_m;
  const int block = WorkingBlock(image);
  const auto pixel_rad = static_cast<float>(1.0 / working.fx);
  cv::Mat means(working.height, working.width, CV_32FC1);
  for (int r = 0; r < means.rows; ++r) {
    auto* const to = means.ptr<float>(r);
    for (int c = 0; c < means.cols; ++c)
      to[c] = DepthOfBlock(depth_m, r * block, c * block, block, noise, pixel_rad);
  }
  return means;
}

Eigen::Vector2d InDepthImage(const Eigen::Vector2d& pixel, const Intrinsics& image,
                             const cv::Mat& depth_m) {
  if (depth_m.cols == image.width) return pixel;
  return ((pixel.array() + 0.5) / WorkingBlock(image) - 0.5).matrix();
}

cv::Mat WorkingColor(const cv::Mat& rgb, const Intrinsics& image) {
  const Intrinsics working = WorkingIntrinsics(image);
  if (IsWorking(rgb, CV_8UC3, image, working)) return rgb;
  const int block = WorkingBlock(image);
  cv::Mat middles(working.height, working.width, CV_8UC3);
  for (int r = 0; r < middles.rows; ++r) {
    const auto* from = rgb.ptr<cv::Vec3b>(r * block + block / 2) + block / 2;
    auto* const to = middles.ptr<cv::Vec3b>(r);
    for (int c = 0; c < middles.cols; ++c) to[c] = from[c * block];
  }
  return middles;
}

}  // namespace plumb
