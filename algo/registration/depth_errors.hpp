// SPDX-License-Identifier: Apache-2.0
// What the depth images of some classes of sensor err by beside the calibration.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>

#include "algo/sensor_calibration/calibration_prior.hpp"

namespace plumb::dense {

/// What one depth image errs by beside the calibration that all images share: an offset (metres)
/// and a tilt (fraction of the depth per half image width), to the right and downwards.
using ImageError = Eigen::Vector3d;

/// Change of a cell's depth with each part of its ImageError.
[[nodiscard]] inline Eigen::Vector3d ImageErrorJacobian(double z_m,
                                                        const Eigen::Vector2f& centred) {
  return {1.0, z_m * centred.x(), z_m * centred.y()};
}

/// A correction that all images share and that depends on the measured depth alone, as the cyclic
/// error of a time-of-flight camera does: piecewise linear between knots, constant beyond the
/// outermost ones. Its waves are some decimetres long, so that ten knots describe one.
class DepthCurve {
 public:
  static constexpr int kSize = 36;
  using Knots = Eigen::Matrix<double, kSize, 1>;
  /// Where a depth lies: (1 - share) of the knot's value and share of the next one's.
  struct Place {
    int knot = 0;
    double share = 0.0;
  };

  [[nodiscard]] static Place At(double z_m) {
    const double at = std::clamp((z_m - kFirst_m) / kStep_m, 0.0, kSize - 1.0);
    const int knot = std::min(static_cast<int>(at), kSize - 2);
    return {knot, at - knot};
  }
  [[nodiscard]] double Correction(double z_m) const {
    const Place place = At(z_m);
    return (1.0 - place.share) * knots_m[place.knot] + place.share * knots_m[place.knot + 1];
  }

  Knots knots_m = Knots::Zero();

 private:
  static constexpr double kFirst_m = 0.25, kStep_m = 0.05;
};

struct DepthErrors {
  std::vector<ImageError> images;  ///< One for each keyframe; empty: there are none, nor a curve.
  DepthCurve curve;

  /// What is added to a depth of an image that the calibration has corrected.
  /// @param z_m  As measured.
  [[nodiscard]] double Correction(std::size_t image, double z_m,
                                  const Eigen::Vector2f& centred) const {
    if (images.empty()) return 0.0;
    return ImageErrorJacobian(z_m, centred).dot(images[image]) + curve.Correction(z_m);
  }
};

/// Covariance of DepthErrors with the calibration. Errors are found where poses and calibration
/// are, so they take up most of what a wrong calibration would do to the depth.
struct DepthErrorColumns {
  /// Three rows for each image, then one for each knot of the curve; empty: there are no errors.
  Eigen::Matrix<double, Eigen::Dynamic, kCalibrationSize> rows;

  std::size_t num_images = 0;

  [[nodiscard]] bool empty() const { return rows.rows() == 0; }
  [[nodiscard]] bool has_curve() const {
    return rows.rows() > static_cast<Eigen::Index>(3 * num_images);
  }
  [[nodiscard]] auto OfImage(std::size_t image) const {
    return rows.middleRows<3>(3 * static_cast<Eigen::Index>(image));
  }
  [[nodiscard]] auto OfCurve() const { return rows.bottomRows<DepthCurve::kSize>(); }
};

}  // namespace plumb::dense
