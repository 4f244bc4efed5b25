// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/registration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace plumb {
namespace {

constexpr double kSameSurface =
    0.02;  // relative depth difference within which samples belong to one surface
constexpr double kOverlap =
    1.1;  // samples cover slightly more than their own area, so that slopes have no seams
constexpr double kMinColorDepth_m = 0.05;
constexpr double kMaxReach_px =
    8.0;  // of one sample; a colour image has at most a few times the resolution of its depth image
constexpr int kSaturatedUnits = 65535;

/// std::ceil() of what an int holds, without the call that it is on processors of 64 bits at large:
/// four for each pixel.
int Ceil(double value) {
  const int towards_zero = static_cast<int>(value);
  return towards_zero + (towards_zero < value ? 1 : 0);
}

}  // namespace

cv::Mat DepthInMetres(const cv::Mat& units, double units_per_metre) {
  cv::Mat depth_m;
  units.convertTo(depth_m, CV_32F, 1.0 / units_per_metre);
  depth_m.setTo(0.0F, units == kSaturatedUnits);
  return depth_m;
}

DepthRegistration::DepthRegistration(const Intrinsics& depth, const Intrinsics& color,
                                     const Pose& T_color_depth)
    : depth_(depth), color_(color), baseline_m_(T_color_depth.translation()) {
  ray_in_color_.reserve(static_cast<std::size_t>(depth.width) *
                        static_cast<std::size_t>(depth.height));
  for (int y = 0; y < depth.height; ++y) {
    for (int x = 0; x < depth.width; ++x) {
      const Eigen::Vector2d ray = Undistort(depth, Eigen::Vector2d(x, y));
      ray_in_color_.emplace_back(T_color_depth.linear() * ray.homogeneous());
    }
  }
  min_view_.setConstant(std::numeric_limits<double>::infinity());
  max_view_.setConstant(-std::numeric_limits<double>::infinity());
  const auto include = [&](double x, double y) {
    const Eigen::Array2d ray = Undistort(color, Eigen::Vector2d(x, y)).array();
    min_view_ = min_view_.min(ray);
    max_view_ = max_view_.max(ray);
  };
  for (int x = 0; x < color.width; ++x) {
    include(x, -0.5);
    include(x, color.height - 0.5);
  }
  for (int y = 0; y < color.height; ++y) {
    include(-0.5, y);
    include(color.width - 0.5, y);
  }
}

cv::Mat DepthRegistration::Register(const cv::Mat& depth_m) const {
  if (depth_m.type() != CV_32FC1 || depth_m.cols != depth_.width || depth_m.rows != depth_.height) {
    throw std::invalid_argument(
        fmt::format("registration needs a CV_32FC1 depth image of {}x{}, got type {} of {}x{}",
                    depth_.width, depth_.height, depth_m.type(), depth_m.cols, depth_m.rows));
  }
  cv::Mat registered = cv::Mat::zeros(color_.height, color_.width, CV_32FC1);
  cv::Mat offset(
      color_.height, color_.width,
      CV_32FC1);  // squared distance of a pixel from the centre of its sample, set together with it
  const double magnification_x = 0.5 * kOverlap * color_.fx / depth_.fx;
  const double magnification_y = 0.5 * kOverlap * color_.fy / depth_.fy;
  const bool has_lens = HasLens(color_);
  const Eigen::Vector3d* ray = ray_in_color_.data();
  for (int row = 0; row < depth_.height; ++row) {
    const auto* depth_row = depth_m.ptr<float>(row);
    for (int column = 0; column < depth_.width; ++column, ++ray) {
      const double z_depth = depth_row[column];
      if (!(z_depth > 0)) continue;
      const Eigen::Vector3d p_color = *ray * z_depth + baseline_m_;
      if (!(p_color.z() > kMinColorDepth_m)) continue;
      const Eigen::Array2d view = p_color.head<2>().array() / p_color.z();
      if ((view < min_view_).any() || (view > max_view_).any()) continue;
      // As Project() does it, bit for bit, without dividing again.
      const Eigen::Vector2d seen =
          has_lens ? DistortNormalised(color_, view.matrix()) : Eigen::Vector2d(view.matrix());
      const Eigen::Vector2d centre(color_.fx * seen.x() + color_.cx,
                                   color_.fy * seen.y() + color_.cy);
      const double reach_x = std::min(magnification_x * z_depth / p_color.z(), kMaxReach_px);
      const double reach_y = std::min(magnification_y * z_depth / p_color.z(), kMaxReach_px);
      const int x_begin = std::max(0, Ceil(centre.x() - reach_x));
      const int x_end = std::min(color_.width, Ceil(centre.x() + reach_x));
      const int y_begin = std::max(0, Ceil(centre.y() - reach_y));
      const int y_end = std::min(color_.height, Ceil(centre.y() + reach_y));
      const auto z = static_cast<float>(p_color.z());
      for (int y = y_begin; y < y_end; ++y) {
        auto* z_row = registered.ptr<float>(y);
        auto* offset_row = offset.ptr<float>(y);
        for (int x = x_begin; x < x_end; ++x) {
          float& z_there = z_row[x];
          float& offset_there = offset_row[x];
          const auto offset_px2 =
              static_cast<float>((centre - Eigen::Vector2d(x, y)).squaredNorm());
          const bool same_surface = std::abs(z - z_there) <= kSameSurface * z;
          if (z_there == 0 || (same_surface ? offset_px2 < offset_there : z < z_there)) {
            z_there = z;
            offset_there = offset_px2;
          }
        }
      }
    }
  }
  return registered;
}

}  // namespace plumb
