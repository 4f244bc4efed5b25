// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/breathing_check.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

Breathing Of(double amplitude_m, double limit_m) {
  return {.amplitude_m = amplitude_m, .period_s = amplitude_m > 0 ? 4.0 : 0.0, .limit_m = limit_m};
}

TEST(BreathingCheckTest, ABodysBreathingIsKeptAsItIsOnTheBody) {
  const Breathing kept = CheckedBreathing(Of(0.008, 0.002), Of(0.007, 0.002), Of(0.006, 0.002));
  EXPECT_EQ(kept.amplitude_m, 0.007);
  EXPECT_EQ(kept.period_s, 4.0);
}

TEST(BreathingCheckTest, OfARigidSceneNoneIsLeft) {
  const Breathing none = CheckedBreathing(Of(0.008, 0.002), Of(0.0, 0.002), Of(0.008, 0.002));
  EXPECT_EQ(none.amplitude_m, 0.0) << "not on a body";
  EXPECT_EQ(none.period_s, 0.0);
  EXPECT_EQ(none.limit_m, 0.008) << "a smaller one could not have been told from it";
  EXPECT_EQ(CheckedBreathing(Of(0.008, 0.002), Of(0.008, 0.002), Of(0.0, 0.003)).amplitude_m, 0.0)
      << "not without the dense terms, which would have shown it";
}

TEST(BreathingCheckTest, ASolutionThatCouldNotHaveShownItDoesNotSpeakAgainstIt) {
  EXPECT_EQ(CheckedBreathing(Of(0.004, 0.002), Of(0.004, 0.002), Of(0.0, 0.006)).amplitude_m,
            0.004);
  EXPECT_EQ(CheckedBreathing(Of(0.0, 0.003), {}, {}).limit_m, 0.003) << "nothing to check";
}

// The floor, 1 m below two cameras that look straight down from different places.
std::vector<SurfacePatch> Floor() {
  std::vector<SurfacePatch> patches;
  for (const float x : {-0.2F, 0.1F, 0.3F})
    patches.push_back(
        {.centre_m = {x, 0.1F, 0.0F}, .samples = {{0, 0.001F, 1.0F}, {1, -0.002F, 1.0F}}});
  return patches;
}

SweepSolution Above(const CalibrationModel& calibration, double lift_m) {
  SweepSolution solution{.calibration = calibration};
  Pose down = Pose::Identity();
  down.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  down.translation() = Eigen::Vector3d(0, 0, 1);
  solution.T_scene_depth.push_back(down);
  down.translation() = Eigen::Vector3d(0.1, 0.1, 1 + lift_m);
  solution.T_scene_depth.push_back(down);
  return solution;
}

TEST(BreathingCheckTest, PatchesMoveAsTheOtherSolutionPlacesThem) {
  Intrinsics stated;
  CalibrationModel from, to;
  from.depth[kDepthScale] = 0.01;
  from.depth[kDepthOffset] = -0.002;
  to = from;
  std::vector<SurfacePatch> same = Floor();
  MovePatches(stated, Above(from, 0), Above(to, 0), same);
  for (const SurfacePatch& patch : same) {
    EXPECT_NEAR(patch.samples[0].distance_m, 0.001, 1e-5);
    EXPECT_NEAR(patch.samples[1].distance_m, -0.002, 1e-5);
  }
  // Depth that is 4 mm longer lowers the floor; a camera that is 3 mm higher raises it.
  to.depth[kDepthOffset] += 0.004;
  std::vector<SurfacePatch> moved = Floor();
  MovePatches(stated, Above(from, 0), Above(to, 0.003), moved);
  for (const SurfacePatch& patch : moved) {
    EXPECT_NEAR(patch.samples[0].distance_m, 0.001 - 0.004, 1e-5);
    EXPECT_NEAR(patch.samples[1].distance_m, -0.002 - 0.004 + 0.003, 1e-5);
  }
}

}  // namespace
}  // namespace plumb
