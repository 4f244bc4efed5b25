// SPDX-License-Identifier: Apache-2.0
#include "algo/base/pose.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/SVD>

namespace plumb {

Eigen::Matrix3d Skew(const Eigen::Vector3d& w) {
  Eigen::Matrix3d m;
  m << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  return m;
}

Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity() + Skew(rotation_vector);
  return Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix();
}

Eigen::Vector3d VectorFromRotation(const Eigen::Matrix3d& rotation) {
  // Via the quaternion: AngleAxis directly from a matrix loses precision near 0 and pi.
  Eigen::Quaterniond q(rotation);
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double sine = q.vec().norm();
  if (sine < 1e-12) return 2.0 * q.vec();
  return q.vec() * (2.0 * std::atan2(sine, q.w()) / sine);
}

Pose PoseFromTwist(const Vector6d& rotation_then_translation) {
  Pose T = Pose::Identity();
  T.linear() = RotationFromVector(rotation_then_translation.head<3>());
  T.translation() = rotation_then_translation.tail<3>();
  return T;
}

Pose PoseAbout(const Eigen::Vector3d& centre, const Vector6d& twist) {
  return Eigen::Translation3d(centre) * PoseFromTwist(twist) * Eigen::Translation3d(-centre);
}

Vector6d TwistFromPose(const Pose& T) {
  Vector6d twist;
  twist << VectorFromRotation(T.linear()), T.translation();
  return twist;
}

Pose Orthonormalised(const Pose& T) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(T.linear(),
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1,
                        (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  Pose result = Pose::Identity();
  result.linear() = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  result.translation() = T.translation();
  return result;
}

Pose Interpolate(const Pose& T_a, const Pose& T_b, double fraction) {
  Pose T = Pose::Identity();
  const Eigen::Matrix3d R_a_b = T_a.linear().transpose() * T_b.linear();
  T.linear() = T_a.linear() * RotationFromVector(fraction * VectorFromRotation(R_a_b));
  T.translation() = T_a.translation() + fraction * (T_b.translation() - T_a.translation());
  return T;
}

double RotationAngle(const Pose& T) { return VectorFromRotation(T.linear()).norm(); }

bool IsFinite(const Pose& T) { return T.matrix().allFinite(); }

}  // namespace plumb
