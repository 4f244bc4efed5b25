// SPDX-License-Identifier: Apache-2.0
// Registers depth images of a separate depth camera to the colour image's pixel grid.
#pragma once

#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"

namespace plumb {

/// CV_32FC1 in metres of 16-bit depth; 0 and 65535 units are no measurement.
[[nodiscard]] cv::Mat DepthInMetres(const cv::Mat& units, double units_per_metre);

/// Projects each depth pixel forward onto the colour image, over the area that it covers there,
/// with the nearest surface on top.
///
/// A colour pixel takes the depth of the sample with the nearest centre among those of one surface;
/// where surfaces differ by more than 2 %, the nearer one is used. Colour pixels that no sample
/// covers remain 0. Both lens models are applied exactly. Thread-safe after construction,
/// deterministic.
class DepthRegistration {
 public:
  /// @param T_color_depth  From the depth camera's frame to the colour camera's, metres.
  DepthRegistration(const Intrinsics& depth, const Intrinsics& color, const Pose& T_color_depth);

  /// @param depth_m  CV_32FC1 of the depth camera's size, metres along its axis, 0 where nothing
  ///         was measured.
  /// @return CV_32FC1 of the colour camera's size, metres along the COLOUR camera's axis, 0 where
  ///         nothing was measured.
  /// @throws std::invalid_argument for another type or size.
  [[nodiscard]] cv::Mat Register(const cv::Mat& depth_m) const;

 private:
  Intrinsics depth_;
  Intrinsics color_;
  std::vector<Eigen::Vector3d> ray_in_color_;  ///< R * (x/z, y/z, 1) of each depth pixel.
  Eigen::Vector3d baseline_m_;  ///< The depth camera's centre in the colour camera's frame.
  /// Range of x/z and y/z in the colour image; outside it the lens model may fold back.
  Eigen::Array2d min_view_;
  Eigen::Array2d max_view_;
};

}  // namespace plumb
