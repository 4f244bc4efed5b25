// SPDX-License-Identifier: Apache-2.0
#include "algo/markers/corner_depth.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace plumb {
namespace {

void CheckSize(const DepthView& view, const RayTable& rays) {
  if (view.depth_m.type() != CV_32FC1 || view.depth_m.cols != rays.width() ||
      view.depth_m.rows != rays.height())
    throw std::invalid_argument(fmt::format(
        "corner depth: depth image {}x{} (type {}) does not fit a camera of {}x{}",
        view.depth_m.cols, view.depth_m.rows, view.depth_m.type(), rays.width(), rays.height()));
}

bool IsInside(const Eigen::Vector2d& pixel, const RayTable& rays) {
  return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < rays.width() - 0.5 &&
         pixel.y() < rays.height() - 0.5;  // false for NaN
}

}  // namespace

int DepthWindow(int window_px_at_640, int image_width) {
  if (window_px_at_640 < 1 || image_width < 1)
    throw std::invalid_argument(fmt::format("corner depth: window of {} px in an image {} wide",
                                            window_px_at_640, image_width));
  const int half =
      static_cast<int>(static_cast<double>(window_px_at_640) * image_width / 640.0 / 2.0);
  return 2 * std::max(1, half) + 1;
}

std::array<std::optional<Eigen::Vector3d>, 4> PaperCornerPositions(const MarkerObservation& marker,
                                                                   const DepthView& view,
                                                                   const RayTable& rays,
                                                                   int window_px_at_640) {
  CheckSize(view, rays);
  const int half = DepthWindow(window_px_at_640, rays.width()) / 2;
  std::array<std::optional<Eigen::Vector3d>, 4> positions;
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d& corner = marker.corners[k];
    if (!IsInside(corner, rays)) continue;
    const int column = static_cast<int>(std::lround(corner.x()));
    const int row = static_cast<int>(std::lround(corner.y()));
    const float at_corner = view.depth_m.at<float>(row, column);
    if (at_corner > 0.0F) {
      positions[k] =
          static_cast<double>(at_corner) * Undistort(rays.intrinsics(), corner).homogeneous();
      continue;
    }
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int count = 0;
    for (int r = std::max(0, row - half); r <= std::min(rays.height() - 1, row + half); ++r) {
      for (int c = std::max(0, column - half); c <= std::min(rays.width() - 1, column + half);
           ++c) {
        const float z = view.depth_m.at<float>(r, c);
        if (!(z > 0.0F)) continue;
        sum += static_cast<double>(z) * rays.ideal(r, c).cast<double>().homogeneous();
        ++count;
      }
    }
    if (count > 0) positions[k] = sum / count;
  }
  return positions;
}

}  // namespace plumb
