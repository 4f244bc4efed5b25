// SPDX-License-Identifier: Apache-2.0
// Rigid poses and the few operations on them that Eigen does not provide.
#pragma once

#include <Eigen/Geometry>

namespace plumb {

/// A rigid transform. A variable `T_a_b` maps coordinates in b to coordinates in a: p_a = T_a_b *
/// p_b. Composition is always Eigen's product (the paper's "T.T' = (RR', t+t')" is not a rigid
/// composition).
using Pose = Eigen::Isometry3d;

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Matrix3x6d = Eigen::Matrix<double, 3, 6>;

/// [w]x, so that Skew(w) * p = w.cross(p).
[[nodiscard]] Eigen::Matrix3d Skew(const Eigen::Vector3d& w);

/// Rotation of a rotation vector (radians), exact for any length.
[[nodiscard]] Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& rotation_vector);

/// Inverse of RotationFromVector(), length in [0, pi].
[[nodiscard]] Eigen::Vector3d VectorFromRotation(const Eigen::Matrix3d& rotation);

/// Pose of the twist (rotation vector, translation), with independent rotation and translation; not
/// the SE(3) exponential.
[[nodiscard]] Pose PoseFromTwist(const Vector6d& rotation_then_translation);

/// The same about a point instead of the origin.
[[nodiscard]] Pose PoseAbout(const Eigen::Vector3d& centre, const Vector6d& twist);

/// Derivative of PoseFromTwist(x) * p to x at 0.
[[nodiscard]] inline Matrix3x6d PointJacobian(const Eigen::Vector3d& p) {
  Matrix3x6d J;
  J << -Skew(p), Eigen::Matrix3d::Identity();
  return J;
}

/// Inverse of PoseFromTwist().
[[nodiscard]] Vector6d TwistFromPose(const Pose& T);

/// Nearest rigid transform to T: its rotation part made orthonormal, determinant +1.
[[nodiscard]] Pose Orthonormalised(const Pose& T);

/// Pose between T_a (fraction 0) and T_b (fraction 1): slerp of the rotation, linear interpolation
/// of the translation. Fractions outside [0, 1] extrapolate with the same constant velocity.
[[nodiscard]] Pose Interpolate(const Pose& T_a, const Pose& T_b, double fraction);

/// Angle of the rotation part, radians in [0, pi].
[[nodiscard]] double RotationAngle(const Pose& T);

/// True if every entry is finite.
[[nodiscard]] bool IsFinite(const Pose& T);

}  // namespace plumb
