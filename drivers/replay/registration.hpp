// Depth images of a separate depth camera, moved onto the colour image's pixel grid.
#pragma once

#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"

namespace plumb {

/// Splats each depth pixel forward onto the colour image, over the area that it covers there,
/// nearest surface first.
///
/// A colour pixel takes the depth of the sample whose centre lies nearest to it among those of one
/// surface; where surfaces differ by more than 2 % the nearer one wins. Colour pixels that no
/// sample covers stay 0. Both lenses are undone and applied exactly. Thread-safe after
/// construction, deterministic.
class DepthRegistration {
 public:
  /// @param T_color_depth  Depth camera's frame to colour camera's, metres.
  DepthRegistration(const Intrinsics& depth, const Intrinsics& color, const Pose& T_color_depth);

  /// @param depth_m  CV_32FC1 of the depth camera's size, metres along its axis, 0 = nothing.
  /// @return CV_32FC1 of the colour camera's size, metres along the COLOUR camera's axis, 0 =
  /// nothing.
  /// @throws std::invalid_argument on another type or size.
  [[nodiscard]] cv::Mat Register(const cv::Mat& depth_m) const;

 private:
  Intrinsics depth_;
  Intrinsics color_;
  std::vector<Eigen::Vector3d> ray_in_color_;  ///< R * (x/z, y/z, 1) of each depth pixel.
  Eigen::Vector3d baseline_m_;  ///< The depth camera's centre in the colour camera's frame.
  Eigen::Array2d min_view_;     ///< x/z, y/z that the colour image can hold; beyond, the lens model
                                ///< may fold back.
  Eigen::Array2d max_view_;
};

}  // namespace plumb
