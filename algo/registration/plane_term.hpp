// SPDX-License-Identifier: Apache-2.0
// The residual of a cell of one depth image to the surface that another one shows.
#pragma once

#include <optional>

#include "algo/registration/depth_row.hpp"
#include "algo/sensor_model/depth_noise.hpp"

namespace plumb::dense {

/// Two views, of which the cells of the first are projected into the second.
struct ViewPair {
  ViewPair(const Sensor& of_both, const View& from, const View& to);

  const Sensor& sensor;
  const View& a;
  const View& b;
  Pose T_b_a;  ///< Between the depth cameras.
};

/// With the corrected points p of a cell in a and of a cell in b (x_a, x_b), b's normal n there,
/// and the slope s of the correction of depth, of both cells in the mean weighted by the variance
/// of their noise:
///
///     r = n . (T_b_a x_a - x_b) / s
///
/// in the twists of both keyframes, the focal lengths and the depth calibration. The normal is that
/// of the linearisation.
struct PlaneTerm {
  std::size_t cell_a = 0;
  std::size_t cell_b = 0;
  Eigen::Vector3f in_b;    ///< Point of a's cell in b's depth camera.
  Eigen::Vector3f normal;  ///< In b's depth camera.
  double distance_m = 0;   ///< n . (T_b_a x_a - x_b)
  float cos_a = 0;         ///< Of the incidence on either side.
  float cos_b = 0;

  /// Nothing if the cells do not show the same surface, or too obliquely.
  /// @param in_b   The point of a's cell in b's depth camera.
  /// @param R_b_a  The pair's rotation.
  /// @param gate_m  Larger distances are not correspondences.
  [[nodiscard]] static std::optional<PlaneTerm> Between(const ViewPair& pair, std::size_t cell_a,
                                                        std::size_t cell_b,
                                                        const Eigen::Vector3f& in_b,
                                                        const Eigen::Matrix3f& R_b_a,
                                                        double gate_m);

  [[nodiscard]] DepthRow Linearise(const ViewPair& pair, const DepthNoise& noise) const;

 private:
  // Of the point-to-plane distance by the noise of each cell, which is along its ray.
  struct Sigmas {
    double a_m = 0;
    double b_m = 0;
  };
  [[nodiscard]] Sigmas SigmasOf(const ViewPair& pair, const DepthNoise& noise) const;
};

}  // namespace plumb::dense
