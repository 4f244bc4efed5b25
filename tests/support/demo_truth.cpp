// SPDX-License-Identifier: Apache-2.0
#include "tests/support/demo_truth.hpp"

#include "algo/base/pose.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"

namespace plumb::testing {
namespace {

/// In the reference marker's frame.
Pose TrueMotion() {
  SimulateOptions options;
  options.frames = 120;
  options.rate_hz = 30;
  options.width = 320;
  options.height = 240;
  const simulated::SuitePlan plan = simulated::PlanSuite(options);
  Pose T_world_marker = Pose::Identity();
  for (const simulated::Board& board : plan.room.boards) {
    if (board.id == plan.reference_marker) T_world_marker = board.T_world_marker;
  }
  return T_world_marker.inverse() * plan.scenes[1].T_world_body *
         plan.scenes[0].T_world_body.inverse() * T_world_marker;
}

}  // namespace

MotionError ErrorOfMotion(const nlohmann::json& result) {
  Pose M;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) M.matrix()(r, c) = result["motion"]["T"][r][c];
  }
  const Pose M_true = TrueMotion();
  const auto& c = result["motion"]["centroid_m"];
  const Eigen::Vector3d centroid(c[0], c[1], c[2]);
  return {.translation_m = (M * centroid - M_true * centroid).norm(),
          .rotation_rad = RotationAngle(M * M_true.inverse())};
}

}  // namespace plumb::testing
