// SPDX-License-Identifier: Apache-2.0
#include "algo/map/dense_view.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace plumb {
namespace {

constexpr int kColumns = 160;
constexpr float kMaxRelativeSpread =
    0.03F;  // Relative depth range within a window; a larger one is an edge, not a slope.
constexpr float kMinFill = 0.6F;

// Mean inverse depth of one window; 0 if it has too few values or contains an edge.
float WindowDepth(const cv::Mat& depth_m, int row0, int column0, int side) {
  float sum = 0;
  float nearest = 1e9F;
  float farthest = 0;
  int count = 0;
  for (int r = row0; r < row0 + side; ++r) {
    const float* line = depth_m.ptr<float>(r);
    for (int c = column0; c < column0 + side; ++c) {
      const float z = line[c];
      if (!(z > 0)) continue;
      sum += 1.0F / z;
      nearest = std::min(nearest, z);
      farthest = std::max(farthest, z);
      ++count;
    }
  }
  if (static_cast<float>(count) < kMinFill * static_cast<float>(side * side)) return 0;
  if (farthest - nearest > kMaxRelativeSpread * nearest + 0.005F) return 0;
  return static_cast<float>(count) / sum;
}

}  // namespace

double Grazing(double cos_incidence) {
  const double theta = std::acos(std::clamp(cos_incidence, 0.17, 1.0));
  return theta / (std::numbers::pi / 2 - theta);
}

double DepthSigma(const DepthNoise& noise, double z_m, double cos_incidence) {
  return noise.Sigma_m(z_m, Grazing(cos_incidence));
}

DenseViewMaker::DenseViewMaker(const Intrinsics& intrinsics)
    : window_px_(std::max(1, intrinsics.width / kColumns)),
      width_(intrinsics.width / window_px_),
      height_(intrinsics.height / window_px_) {
  auto rays = std::make_shared<std::vector<Eigen::Vector2f>>();
  rays->reserve(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  const double half = (window_px_ - 1) / 2.0;
  for (int r = 0; r < height_; ++r)
    for (int c = 0; c < width_; ++c)
      rays->push_back(
          Undistort(intrinsics, {c * window_px_ + half, r * window_px_ + half}).cast<float>());
  rays_ = std::move(rays);
}

DenseView DenseViewMaker::Measured(const cv::Mat& depth_m, int stride) const {
  DenseView view;
  view.window_px = window_px_;
  view.width = width_;
  view.height = height_;
  view.rays = rays_;
  view.z_m.assign(rays_->size(), 0.0F);
  for (int r = 0; r < height_; r += stride)
    for (int c = 0; c < width_; c += stride)
      view.z_m[static_cast<std::size_t>(r * width_ + c)] =
          WindowDepth(depth_m, r * window_px_, c * window_px_, window_px_);
  return view;
}

DenseView DenseViewMaker::MakeForPose(const cv::Mat& depth_m) const {
  return Measured(depth_m, kPoseStride);
}

DenseView DenseViewMaker::Make(const cv::Mat& depth_m) const {
  DenseView view = Measured(depth_m, 1);
  view.normals.assign(rays_->size(), Eigen::Vector3f::Zero());
  for (int r = 1; r + 1 < view.height; ++r) {
    for (int c = 1; c + 1 < view.width; ++c) {
      const auto i = static_cast<std::size_t>(r * view.width + c);
      const auto w = static_cast<std::size_t>(view.width);
      const float z = view.z_m[i];
      const float limit = kMaxRelativeSpread * 2 * z + 0.01F;
      bool whole = z > 0;
      for (const std::size_t j : {i - 1, i + 1, i - w, i + w})
        whole = whole && view.z_m[j] > 0 && std::abs(view.z_m[j] - z) < limit;
      if (!whole) continue;
      const Eigen::Vector3f normal = (view.point(i + w) - view.point(i - w))
                                         .cross(view.point(i + 1) - view.point(i - 1))
                                         .normalized();
      // (down x right) points to the camera for a surface that faces it.
      if (normal.dot(view.point(i)) < 0) view.normals[i] = normal;
    }
  }
  return view;
}

}  // namespace plumb
