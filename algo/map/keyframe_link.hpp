// SPDX-License-Identifier: Apache-2.0
// A measured relative pose of two keyframes.
#pragma once

#include "algo/base/pose.hpp"

namespace plumb {

/// Relative pose of two keyframes: T_a_b is keyframe b's colour camera in keyframe a's.
struct KeyframeLink {
  int a = 0;
  int b = 0;
  Pose T_a_b = Pose::Identity();
};

/// Normal equations of a link in the twists of both cameras, on the cameras' side, for the
/// residuals r = (log(R_ba' R_a^T R_b) / sigma_rad, (R_a^T (t_b - t_a) - t_ab') / sigma_m): 1/2 x'
/// H x + g' x.
struct LinkEquations {
  Eigen::Matrix<double, 12, 12> H;
  Eigen::Matrix<double, 12, 1> g;
};
[[nodiscard]] LinkEquations Linearise(const KeyframeLink& link, const Pose& T_world_a,
                                      const Pose& T_world_b, double sigma_rad, double sigma_m);

}  // namespace plumb
