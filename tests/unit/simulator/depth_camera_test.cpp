// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/depth_camera.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <opencv2/core.hpp>

#include "drivers/simulator/sensor/ps1080.hpp"
#include "tests/unit/simulator/simulated_support.hpp"

namespace plumb::simulated {
namespace {

constexpr double kHeight = 0.80;

// Depth of the floor z = 0 in a pixel of a camera with the given pose, from the plane's equation.
double FloorDepth(const Intrinsics& camera, const Pose& T_world_camera, double x, double y) {
  const Eigen::Vector2d ideal = Undistort(camera, {x, y});
  const Eigen::Vector3d direction =
      T_world_camera.linear() * Eigen::Vector3d(ideal.x(), ideal.y(), 1.0);
  return -T_world_camera.translation().z() / direction.z();
}

TEST(DepthCameraTest, IdealDepthIsThatOfThePlaneAndTheBall) {
  const Eigen::Vector3d centre(0.05, -0.04, 0.15);
  const World world = BallWorld(centre);
  const SensorUnit unit = MakeSensorUnit(NoiseLevel::kIdeal, 1, 640, 480);
  const Trajectory trajectory(Standing(kHeight));
  const DepthShot shot = DepthCamera(unit).Render(world, trajectory, 2.0, 1);
  const Pose T_world_camera = trajectory.T_world_camera(2.0);
  int on_ball = 0;
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) {
      const Eigen::Vector2d ideal = Undistort(unit.color_true, {x, y});
      const Eigen::Vector3d way =
          T_world_camera.linear() * Eigen::Vector3d(ideal.x(), ideal.y(), 1.0);
      const Eigen::Vector3d from = T_world_camera.translation() - centre;
      const double b = from.dot(way) / way.squaredNorm();
      const double c = (from.squaredNorm() - kBallRadius * kBallRadius) / way.squaredNorm();
      const double root = b * b - c;
      const double depth = shot.registered.at<std::uint16_t>(y, x) / unit.depth_units_per_metre;
      if (std::abs(root) < 0.003) continue;  // The rim, where the ray grazes.
      if (root > 0) {
        ++on_ball;
        EXPECT_NEAR(depth, -b - std::sqrt(root),
                    4e-4);  // Half a unit of the file is 1e-4, the cells of the ball 3e-4.
      } else {
        EXPECT_NEAR(depth, FloorDepth(unit.color_true, T_world_camera, x, y), 1.01e-4);
      }
    }
  }
  EXPECT_GT(on_ball, 5000);
}

TEST(DepthCameraTest, RollingShutterReadsEachRowAtItsOwnTime) {
  const World world = BallWorld({0.0, 0.0, -0.5});
  SensorUnit unit = MakeSensorUnit(NoiseLevel::kIdeal, 1, 320, 240);
  unit.depth_readout_s = 0.030;
  SweepOptions sweep = Standing(kHeight);
  sweep.swing_m = 0.15;
  sweep.tremor = 3.0;  // Turns and heaves, so that rows differ in depth on a plane.
  const Trajectory trajectory(sweep);
  const DepthShot shot = DepthCamera(unit).Render(world, trajectory, 3.0, 1);
  double worst = 0, worst_at_middle_time = 0;
  for (int y = 0; y < 240; ++y) {
    const Pose T_row =
        trajectory.T_world_camera(3.0 + unit.depth_readout_s * ((y + 0.5) / 240 - 0.5));
    for (int x = 0; x < 320; x += 7) {
      const double z = shot.true_m.at<float>(y, x);
      worst = std::max(worst, std::abs(z - FloorDepth(unit.depth_true, T_row, x, y)));
      worst_at_middle_time =
          std::max(worst_at_middle_time,
                   std::abs(z - FloorDepth(unit.depth_true, trajectory.T_world_camera(3.0), x, y)));
    }
  }
  EXPECT_LT(worst, 2e-5);
  EXPECT_GT(worst_at_middle_time, 20 * worst);
}

TEST(DepthCameraTest, AxialNoiseFollowsTheModelInSizeAndCorrelation) {
  SensorUnit unit = MakeSensorUnit(NoiseLevel::kIdeal, 1, 640, 480);
  unit.axial_noise = 1.0;
  const World world = BallWorld({0.0, 0.0, -0.5});
  const DepthShot shot = DepthCamera(unit).Render(world, Trajectory(Standing(kHeight)), 2.0, 7);
  double variance = 0, expected = 0, covariance = 0;
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 620; ++x) {
      const double error = shot.measured_m.at<float>(y, x) - shot.true_m.at<float>(y, x);
      const double other = shot.measured_m.at<float>(y, x + 9) - shot.true_m.at<float>(y, x + 9);
      const double incidence = std::atan(
          std::hypot((x - 319.5) / 525.0,
                     (y - 239.5) / 525.0));  // The sensor looks down within a few degrees.
      const double z = shot.true_m.at<float>(y, x);
      const double rest = std::numbers::pi / 2 - incidence;
      const double sigma = 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4) +
                           0.0001 / std::sqrt(z) * incidence * incidence / (rest * rest);
      variance += error * error;
      covariance += error * other;
      expected += sigma * sigma;
    }
  }
  // About 2700 independent values: 2.7 % of the variance; limits are three times that.
  EXPECT_NEAR(variance / expected, 1.0, 0.08);
  EXPECT_NEAR(covariance / variance, 0.10, 0.08);
}

TEST(DepthCameraTest, SystematicErrorsAreScaleAndOffset) {
  SensorUnit unit = MakeSensorUnit(NoiseLevel::kIdeal, 1, 160, 120);
  unit.depth_scale_error = 0.004;
  unit.depth_offset_m = -0.001;
  const DepthShot shot =
      DepthCamera(unit).Render(BallWorld({0, 0, -0.5}), Trajectory(Standing(kHeight)), 2.0, 7);
  for (int y = 0; y < 120; y += 7) {
    for (int x = 0; x < 160; x += 7)
      EXPECT_NEAR(shot.measured_m.at<float>(y, x), 1.004 * shot.true_m.at<float>(y, x) - 0.001,
                  1e-6);
  }
}

TEST(DepthCameraTest, QuantisedDepthHasOnlyTheSensorsValues) {
  const SensorUnit unit = MakeSensorUnit(NoiseLevel::kNominal, 3, 320, 240);
  const DepthShot shot =
      DepthCamera(unit).Render(BallWorld({0, 0, 0.1}), Trajectory(Standing(kHeight)), 2.0, 7);
  std::vector<bool> possible(5000, false);
  for (int code = 1; Ps1080DepthOfCode(code) < 5000 && code < 1090; ++code)
    possible[static_cast<std::size_t>(Ps1080DepthOfCode(code))] = true;
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      const float depth = shot.measured_m.at<float>(y, x);
      if (depth == 0) continue;
      ASSERT_TRUE(possible[static_cast<std::size_t>(std::lround(depth * 1000))]) << depth;
    }
  }
}

// Pixels without depth in one row, left of the ball's middle and right of it.
std::pair<int, int> LostBeside(const DepthShot& shot, int row) {
  const float* truth = shot.true_m.ptr<float>(row);
  const auto on_ball = [](float depth) { return depth < 0.7F; };
  const auto first = std::find_if(truth, truth + shot.true_m.cols, on_ball) - truth;
  const auto beyond = std::find_if_not(truth + first, truth + shot.true_m.cols, on_ball) - truth;
  std::pair<int, int> lost{0, 0};
  for (int x = 0; x < shot.true_m.cols; ++x) {
    if (shot.measured_m.at<float>(row, x) == 0)
      ++(2 * x < first + beyond ? lost.first : lost.second);
  }
  return lost;
}

TEST(DepthCameraTest, TheProjectorsShadowLiesLeftOfTheForeground) {
  SensorUnit unit = MakeSensorUnit(NoiseLevel::kIdeal, 1, 640, 480);
  const World world = BallWorld({0, 0, 0.2});
  const Trajectory trajectory(Standing(kHeight));
  EXPECT_EQ(LostBeside(DepthCamera(unit).Render(world, trajectory, 2.0, 1), 240),
            std::make_pair(0, 0));

  unit.projector_baseline_m = 0.075;
  const auto [left, right] = LostBeside(DepthCamera(unit).Render(world, trajectory, 2.0, 1), 240);
  // b f (1/z_f - 1/z_b): the rim of a ball 0.6 m away is seen at z_f = 0.6 - 0.1^2 / 0.6 = 0.583,
  // the floor at 0.8: 18.3 pixels; measured 19.
  EXPECT_NEAR(left, 18.3, 1.5);
  EXPECT_EQ(right, 0);
}

TEST(DepthCameraTest, RegistrationErrsOnNominalAndNotOnIdeal) {
  const World world = BallWorld({0, 0, -0.5});
  const Trajectory trajectory(Standing(kHeight));
  const auto lost_fraction = [](const cv::Mat& registered) {
    return 1.0 - static_cast<double>(cv::countNonZero(registered)) /
                     static_cast<double>(registered.total());
  };
  const SensorUnit ideal = MakeSensorUnit(NoiseLevel::kIdeal, 1, 640, 480);
  EXPECT_EQ(lost_fraction(DepthCamera(ideal).Render(world, trajectory, 2.0, 1).registered), 0.0);
  EXPECT_TRUE(ideal.T_color_depth_true.isApprox(ideal.T_color_depth_assumed));

  const SensorUnit nominal = MakeSensorUnit(NoiseLevel::kNominal, 1, 640, 480);
  // The depth camera's view is narrower: a dark rim of 10 to 25 % is left.
  const double lost =
      lost_fraction(DepthCamera(nominal).Render(world, trajectory, 2.0, 1).registered);
  EXPECT_GT(lost, 0.08);
  EXPECT_LT(lost, 0.30);
  EXPECT_FALSE(nominal.T_color_depth_true.isApprox(nominal.T_color_depth_assumed, 1e-5));
  // A point half a metre away lands 0.2 to 5 pixels off.
  const Eigen::Vector3d p(0.05, 0.04, 0.8);
  const Eigen::Vector2d off = Project(nominal.color_true, nominal.T_color_depth_true * p) -
                              Project(nominal.color_true, nominal.T_color_depth_assumed * p);
  EXPECT_GT(off.norm(), 0.2);
  EXPECT_LT(off.norm(), 5.0);
}

TEST(DepthCameraTest, DoesNotDependOnTheNumberOfThreads) {
  const DepthCamera camera(MakeSensorUnit(NoiseLevel::kNominal, 1, 320, 240));
  const World world = BallWorld({0, 0, 0.1});
  const Trajectory trajectory(Standing(kHeight));
  const auto render = [&](std::size_t threads, std::uint64_t seed) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return camera.Render(world, trajectory, 1.0, seed).registered;
  };
  const cv::Mat one = render(1, 5);
  EXPECT_EQ(cv::countNonZero(one != render(4, 5)), 0);
  EXPECT_GT(cv::countNonZero(one != render(1, 6)), 1000);
}

}  // namespace
}  // namespace plumb::simulated
