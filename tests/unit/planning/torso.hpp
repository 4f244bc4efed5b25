// SPDX-License-Identifier: Apache-2.0
// The simulated body whose planning CT the tests read.
#pragma once

#include <Eigen/Geometry>

#include "algo/base/pose.hpp"
#include "drivers/simulator/suites/planning_ct.hpp"

namespace plumb::testing {

inline const simulated::BodyModel& Torso() {
  static const auto body = simulated::MakeBody({.kind = simulated::BodyKind::kTorso});
  return *body;
}

/// It lies on z = -0.12 m, head to the gantry, turned by 2 deg.
inline Pose PlaceOfTorso() {
  Eigen::Matrix3d R;
  R << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  Pose T = Pose::Identity();
  T.linear() = Eigen::AngleAxisd(0.035, Eigen::Vector3d::UnitZ()).toRotationMatrix() * R;
  T.translation() = Eigen::Vector3d(0.02, -0.03, -0.12);
  return T;
}

}  // namespace plumb::testing
