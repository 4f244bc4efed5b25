// SPDX-License-Identifier: Apache-2.0
#include "algo/map/keyframe_link.hpp"

namespace plumb {

LinkEquations Linearise(const KeyframeLink& link, const Pose& T_world_a, const Pose& T_world_b,
                        double sigma_rad, double sigma_m) {
  const Pose T_a_b = T_world_a.inverse() * T_world_b;
  Vector6d r;
  r << VectorFromRotation(link.T_a_b.linear().transpose() * T_a_b.linear()),
      T_a_b.translation() - link.T_a_b.translation();
  Eigen::Matrix<double, 6, 12> J = Eigen::Matrix<double, 6, 12>::Zero();
  J.block<3, 3>(0, 0) = -T_a_b.linear().transpose();
  J.block<3, 3>(0, 6).setIdentity();
  J.block<3, 3>(3, 0) = Skew(T_a_b.translation());
  J.block<3, 3>(3, 3) = -Eigen::Matrix3d::Identity();
  J.block<3, 3>(3, 9) = T_a_b.linear();
  Vector6d weight;
  weight << Eigen::Vector3d::Constant(1.0 / (sigma_rad * sigma_rad)),
      Eigen::Vector3d::Constant(1.0 / (sigma_m * sigma_m));
  return {J.transpose() * weight.asDiagonal() * J, J.transpose() * (weight.asDiagonal() * r)};
}

}  // namespace plumb
