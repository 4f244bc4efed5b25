// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/pose_optimizer.hpp"

#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/unit/tracking/synthetic_map.hpp"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

const Pose kTruth = PoseFromTwist((Vector6d() << 0.3, -0.2, 0.5, 0.4, -0.1, 0.2).finished());
const Pose kOff = PoseFromTwist((Vector6d() << 0.02, -0.015, 0.02, 0.02, -0.03, 0.015).finished());

std::vector<PosePoint> Points(int count, double outlier_fraction, double sigma, bool with_depth) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal;
  std::vector<PosePoint> points;
  for (int i = 0; i < count; ++i) {
    const double z = 0.9 + 0.3 * uniform(random);
    const Vector2d ideal(0.55 * uniform(random), 0.4 * uniform(random));
    PosePoint point;
    point.p_world = kTruth * Vector3d(ideal.x() * z, ideal.y() * z, z);
    point.ideal = ideal + sigma * Vector2d(normal(random), normal(random));
    point.sigma = sigma > 0 ? sigma : 0.001;
    if (i < outlier_fraction * count)
      point.ideal += 0.2 * Vector2d(uniform(random), uniform(random));
    if (with_depth) {
      point.inverse_z = 1.0 / z;
      point.inverse_z_sigma = 0.005;
    }
    points.push_back(point);
  }
  return points;
}

double Translation(const Pose& T) { return (kTruth.inverse() * T).translation().norm(); }

TEST(OptimizePose, ExactPointsGiveTheExactPose) {
  for (const bool with_depth : {false, true}) {
    PoseProblem problem;
    problem.points = Points(60, 0, 0, with_depth);
    const PoseEstimate estimate = OptimizePose(problem, kTruth * kOff);
    EXPECT_TRUE(estimate.converged);
    EXPECT_EQ(estimate.num_inliers, 60);
    EXPECT_LT(Translation(estimate.T_world_camera), 1e-7);  // Measured: 1e-9, the damping's.
    EXPECT_LT(RotationAngle(kTruth.inverse() * estimate.T_world_camera), 1e-7);
  }
}

TEST(OptimizePose, FortyPercentOutliersDoNotPull) {
  PoseProblem problem;
  problem.points = Points(200, 0.4, 0.001, true);
  problem.num_iterations = 30;
  const PoseEstimate estimate = OptimizePose(problem, kTruth * kOff);
  fmt::print("translation {:.2e} m, {} inliers\n", Translation(estimate.T_world_camera),
             estimate.num_inliers);
  EXPECT_LT(Translation(estimate.T_world_camera), 0.001);
  int wrong = 0;
  for (std::size_t i = 80; i < 200; ++i) wrong += estimate.inlier[i] ? 0 : 1;
  EXPECT_LE(wrong, 6) << "of 120 good points; 3 sigma in two coordinates leave 1.1 % out";
  EXPECT_LE(estimate.num_inliers, 125) << "hardly an outlier may pass";
}

TEST(OptimizePose, FourCornersOfAMarkerSuffice) {
  PoseProblem problem;
  constexpr double h = 0.052;
  for (const Vector3d& p :
       {Vector3d(-h, h, 0.8), Vector3d(h, h, 0.82), Vector3d(h, -h, 0.84), Vector3d(-h, -h, 0.82)})
    problem.points.push_back(
        {.p_world = kTruth * p, .ideal = p.head<2>() / p.z(), .sigma = 0.0005});
  problem.num_iterations = 30;
  const PoseEstimate estimate = OptimizePose(problem, kTruth * kOff);
  EXPECT_LT(Translation(estimate.T_world_camera), 1e-4);
}

TEST(OptimizePose, DepthAloneHoldsThePoseOverShape) {
  // Two views of the landscape, no points at all.
  const auto truth = synthetic::MakeTrueMap(
      {.num_keyframes = 16, .num_landmarks = 0, .markers = false, .dense = true});
  const MapKeyframe& target = truth.map.keyframes[7];
  const MapKeyframe& frame = truth.map.keyframes[8];
  const auto depth_pose = [](const MapKeyframe& k) {
    return PoseAfter(k.T_world_color, k.velocity_per_s, k.data.depth_time_s - k.data.color_time_s);
  };
  PoseProblem problem;
  problem.intrinsics = truth.stated;
  problem.dense_frame = &frame.dense;
  problem.dense_target = &target.dense;
  problem.T_world_target = depth_pose(target);
  problem.T_color_depth = frame.T_world_color.inverse() * depth_pose(frame);
  problem.num_iterations = 30;
  Pose T_start = frame.T_world_color *
                 PoseFromTwist((Vector6d() << 0.01, -0.008, 0.01, 0.012, -0.01, 0.01).finished());
  const PoseEstimate estimate = OptimizePose(problem, T_start);
  const Pose error = frame.T_world_color.inverse() * estimate.T_world_camera;
  fmt::print("dense: {:.2e} m {:.2e} rad, overlap {:.2f}, rms {:.2e} m\n",
             error.translation().norm(), RotationAngle(error), estimate.dense_overlap,
             estimate.dense_rms_m);
  EXPECT_LT(error.translation().norm(), 1e-4);  // Measured: 0.004 mm.
  EXPECT_LT(RotationAngle(error), 1e-4);
  EXPECT_GT(estimate.dense_overlap, 0.5);
}

TEST(OptimizePose, NothingToGoByLeavesTheStart) {
  const PoseEstimate estimate = OptimizePose({}, kTruth);
  EXPECT_LT(Translation(estimate.T_world_camera), 1e-12);
  EXPECT_EQ(estimate.num_inliers, 0);
}

TEST(OptimizePose, DepthIsTrustedByTheNoiseThatIsStatedForIt) {
  const auto truth = synthetic::MakeTrueMap(
      {.num_keyframes = 2, .num_landmarks = 0, .markers = false, .dense = true});
  const auto information = [&](double factor) {
    PoseProblem problem;
    problem.intrinsics = truth.stated;
    problem.dense_frame = &truth.map.keyframes[1].dense;
    problem.dense_target = &truth.map.keyframes[0].dense;
    problem.T_world_target = truth.map.keyframes[0].T_world_color;
    problem.depth_noise.constant_m *= factor;
    problem.depth_noise.quadratic_m_per_m2 *= factor;
    problem.depth_noise.grazing_m *= factor;
    return OptimizePose(problem, truth.map.keyframes[1].T_world_color).information.trace();
  };
  // sqrt(2) sigma + 2 mm, with sigma of about 2 mm and of 20 mm: (4.8 / 30)^2 of the information.
  EXPECT_NEAR(information(10.0) / information(1.0), 0.025, 0.015);
}

}  // namespace
}  // namespace plumb
