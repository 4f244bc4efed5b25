// SPDX-License-Identifier: Apache-2.0
// The rotation that the couch's angles stand for, as the README defines it.
#pragma once

#include <Eigen/Geometry>

namespace plumb::testing {

/// Rz(yaw) Rx(pitch) Ry(roll), radians.
inline Eigen::Matrix3d CouchRotation(double pitch_rad, double roll_rad, double yaw_rad) {
  return (Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitY()))
      .toRotationMatrix();
}

}  // namespace plumb::testing
