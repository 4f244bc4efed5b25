// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/trajectory.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

using Eigen::Vector3d;

Pose At(double x, double y = 0, double angle = 0) {
  Pose T = Pose::Identity();
  T.linear() = Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix();
  T.translation() = Vector3d(x, y, 0);
  return T;
}

// Two keyframes as tracked at x = 0 and x = 0.4, three frames between them and one after.
struct Path {
  std::vector<TrackedFrame> frames;
  TrackingMap map;
};

Path Tracked() {
  Path path;
  path.map.keyframes.resize(2);
  path.map.keyframes[1].T_world_color = At(0.4);
  for (int i = 0; i < 6; ++i) {
    TrackedFrame frame;
    frame.frame_index = i;
    frame.color_time_s = 10.0 + 0.1 * i;
    frame.depth_time_s = frame.color_time_s + 0.02;
    frame.tracked = true;
    frame.reference_keyframe = i < 4 ? 0 : 1;
    frame.T_reference_color = i < 4 ? At(0.1 * i) : At(0.1 * (i - 4));
    if (i == 0) frame.keyframe = 0;
    if (i == 4) {
      frame.keyframe = 1;
      frame.previous_keyframe = 0;
      frame.T_previous_color = At(0.4);
    }
    path.frames.push_back(frame);
  }
  return path;
}

TEST(Trajectory, FramesBetweenKeyframesTakeTheirShareOfTheRefinement) {
  Path path = Tracked();
  path.map.keyframes[1].T_world_color = At(0.4, 0.08);  // Refined by 8 cm to the side.
  const auto poses = ColorPoses(path.frames, path.map);
  ASSERT_EQ(poses.size(), 6U);
  for (int i = 0; i <= 4; ++i)
    EXPECT_LT(
        (poses[static_cast<std::size_t>(i)].translation() - Vector3d(0.1 * i, 0.02 * i, 0)).norm(),
        1e-12)
        << i;
  EXPECT_LT((poses[5].translation() - Vector3d(0.5, 0.08, 0)).norm(), 1e-12)
      << "after the last keyframe: rigidly with it";
}

TEST(Trajectory, KeyframeThatMovesTakesItsFramesAlong) {
  Path path = Tracked();
  const Pose T_moved = At(3, 1, 0.5);
  for (MapKeyframe& keyframe : path.map.keyframes)
    keyframe.T_world_color = T_moved * keyframe.T_world_color;
  const auto poses = ColorPoses(path.frames, path.map);
  for (int i = 0; i < 6; ++i)
    EXPECT_LT(
        (poses[static_cast<std::size_t>(i)].matrix() - (T_moved * At(0.1 * i)).matrix()).norm(),
        1e-12)
        << i;
}

TEST(Trajectory, UntrackedFramesHaveNoPose) {
  Path path = Tracked();
  path.frames[2].tracked = false;
  EXPECT_EQ(DepthTrajectory(path.frames, path.map, {}, Pose::Identity()).size(), 5U);
  EXPECT_EQ(ColorPoses(path.frames, path.map)[2].matrix(), Pose::Identity().matrix());
}

TEST(Trajectory, DepthPosesAreTakenAtTheDepthStampAndItsDelay) {
  Path path = Tracked();
  RefreshVelocities(path.frames, path.map);
  for (const TrackedFrame& frame : path.frames)
    EXPECT_LT((frame.velocity_per_s.tail<3>() - Vector3d(1, 0, 0)).norm(), 1e-9);
  EXPECT_LT((path.map.keyframes[1].velocity_per_s.tail<3>() - Vector3d(1, 0, 0)).norm(), 1e-9);
  CalibrationModel calibration;
  calibration.depth[5] = 0.005;
  const auto trajectory = DepthTrajectory(path.frames, path.map, calibration, At(0, 7));
  ASSERT_EQ(trajectory.size(), 6U);
  EXPECT_DOUBLE_EQ(trajectory[3].time_s, 10.32);
  EXPECT_LT((trajectory[3].T_world_camera.translation() - Vector3d(0.325, 7, 0)).norm(), 1e-9);
}

TEST(Trajectory, VelocitiesFollowATremblingHand) {
  // 8 Hz at 30 images a second: the neighbours' difference alone would see 0.59 of it.
  constexpr double kTurnsPerSecond = 8.0;
  constexpr double kAmplitude_m = 0.002;
  constexpr double kRate = 2.0 * 3.14159265358979 * kTurnsPerSecond;
  Path path;
  path.map.keyframes.resize(1);
  for (int i = 0; i < 60; ++i) {
    TrackedFrame frame;
    frame.frame_index = i;
    frame.color_time_s = frame.depth_time_s = i / 30.0;
    frame.tracked = true;
    frame.reference_keyframe = 0;
    if (i == 0) frame.keyframe = 0;
    // The camera looks another way than the world's axes: velocities are in its own.
    frame.T_reference_color =
        At(kAmplitude_m * std::sin(kRate * frame.color_time_s), 0, 0.5 * 3.14159265358979);
    path.frames.push_back(frame);
  }
  path.frames[0].T_reference_color = Pose::Identity();
  path.map.keyframes[0].T_world_color = Pose::Identity();
  RefreshVelocities(path.frames, path.map);
  double seen = 0;
  double shaken = 0;
  for (std::size_t i = 5; i < 55; ++i) {
    const double expected = kAmplitude_m * kRate * std::cos(kRate * path.frames[i].color_time_s);
    seen += -path.frames[i].velocity_per_s[4] * expected;
    shaken += expected * expected;
    EXPECT_LT(std::abs(path.frames[i].velocity_per_s[3]), 1e-9);
  }
  EXPECT_GT(seen / shaken, 0.7);
  EXPECT_LT(seen / shaken, 1.0);
}

TEST(Trajectory, VelocityIsNotTakenAcrossAGap) {
  Path path = Tracked();
  for (std::size_t i = 3; i < 6; ++i) path.frames[i].color_time_s += 5.0;
  RefreshVelocities(path.frames, path.map);
  EXPECT_LT((path.frames[2].velocity_per_s.tail<3>() - Vector3d(1, 0, 0)).norm(), 1e-9)
      << "backward difference";
}

TEST(Trajectory, VelocityIsNotTakenAcrossAnImplausibleStamp) {
  Path path = Tracked();
  path.frames[2].color_time_s = path.frames[3].color_time_s - 0.001;  // stamped on arrival
  for (TrackedFrame& frame : path.frames) frame.velocity_per_s.setZero();
  RefreshVelocities(path.frames, path.map);
  for (const TrackedFrame& frame : path.frames)
    EXPECT_LT(frame.velocity_per_s.tail<3>().norm(), 1.2)
        << frame.frame_index << ": the truth is 1 m/s";
}

TEST(LongestLost, CountsTheTimeWithoutAPose) {
  Path path = Tracked();
  EXPECT_EQ(LongestLost(path.frames), 0.0);
  EXPECT_EQ(LongestLost({}), 0.0);
  path.frames[2].tracked = path.frames[3].tracked = false;
  EXPECT_NEAR(LongestLost(path.frames), 0.3, 1e-12);  // From frame 1 to frame 4.
  path.frames[3].tracked = true;
  EXPECT_NEAR(LongestLost(path.frames), 0.2, 1e-12);
  for (TrackedFrame& frame : path.frames) frame.tracked = frame.frame_index < 2;
  EXPECT_NEAR(LongestLost(path.frames), 0.4, 1e-12) << "lost to the end";
}

TEST(LongestLost, CountsImagesThatNeverCame) {
  Path path = Tracked();
  for (std::size_t i = 3; i < 6; ++i) path.frames[i].color_time_s += 1.5;
  EXPECT_NEAR(LongestLost(path.frames), 1.6, 1e-12) << "between two tracked frames";
  path.frames[3].tracked = false;
  EXPECT_NEAR(LongestLost(path.frames), 1.7, 1e-12) << "and to the next frame that was tracked";
}

TEST(LongestLost, LowAndUnevenRatesAreNoGaps) {
  Path path = Tracked();
  for (TrackedFrame& frame : path.frames)
    frame.color_time_s = 1.2 * static_cast<double>(frame.frame_index);
  EXPECT_EQ(LongestLost(path.frames), 0.0) << "a slow recording";
  const std::vector<double> uneven = {0.0,  0.04, 0.11,
                                      0.24, 0.30, 0.36};  // Two images skipped now and then.
  for (std::size_t i = 0; i < uneven.size(); ++i) path.frames[i].color_time_s = uneven[i];
  EXPECT_EQ(LongestLost(path.frames), 0.0);
}

}  // namespace
}  // namespace plumb
