// SPDX-License-Identifier: Apache-2.0
// A depth image reduced for registration: averaged windows with normals.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/sensor_model/depth_noise.hpp"

namespace plumb {

/// A depth image at a fraction of its resolution. Every cell is the mean inverse depth of its
/// window, kept only if the window is filled and smooth, with the surface normal. Row-major, camera
/// frame.
struct DenseView {
  int width = 0;
  int height = 0;
  int window_px = 4;       ///< Side length of a cell's window at full resolution.
  std::vector<float> z_m;  ///< 0 where the depth is not usable.
  std::vector<Eigen::Vector3f>
      normals;  ///< Unit length, towards the camera; zero where it could not be computed.
  std::shared_ptr<const std::vector<Eigen::Vector2f>>
      rays;  ///< Ideal normalised coordinates of the cell centres; shared.

  [[nodiscard]] std::size_t size() const { return z_m.size(); }
  [[nodiscard]] Eigen::Vector3f point(std::size_t i) const {
    return {(*rays)[i].x() * z_m[i], (*rays)[i].y() * z_m[i], z_m[i]};
  }
};

/// Spacing in each direction of the cells from which a frame's pose is computed.
inline constexpr int kPoseStride = 2;

/// Makes dense views of one camera's depth images. Keeps the rays, which cost more than the view
/// itself. The window follows the resolution, so that 640x480 and 320x240 both give 160x120 cells.
class DenseViewMaker {
 public:
  explicit DenseViewMaker(const Intrinsics& intrinsics);
  /// @param depth_m  CV_32FC1 of the intrinsics' size; 0 where nothing was measured.
  [[nodiscard]] DenseView Make(const cv::Mat& depth_m) const;
  /// The part of Make() that the pose of a frame uses, at a quarter of the cost: depth in every
  /// kPoseStride-th cell in each direction, and no normals.
  [[nodiscard]] DenseView MakeForPose(const cv::Mat& depth_m) const;

 private:
  [[nodiscard]] DenseView Measured(const cv::Mat& depth_m, int stride) const;

  int window_px_;
  int width_;
  int height_;
  std::shared_ptr<const std::vector<Eigen::Vector2f>> rays_;
};

/// The incidence as DepthNoise::Sigma_m() takes it, at most that of 80 deg; cos_incidence in (0,
/// 1]. Slow: for repeated measurements of one surface it is computed once.
[[nodiscard]] double Grazing(double cos_incidence);
/// Standard deviation of one depth measurement, metres; cos_incidence in (0, 1].
[[nodiscard]] double DepthSigma(const DepthNoise& noise, double z_m, double cos_incidence);

}  // namespace plumb
