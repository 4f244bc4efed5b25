// SPDX-License-Identifier: Apache-2.0
#include "algo/geometry/rigid_fit.hpp"

#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

using Points = std::vector<Eigen::Vector3d>;

Points RandomPoints(std::mt19937& random, int count, const Eigen::Vector3d& extent) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Points points;
  for (int i = 0; i < count; ++i)
    points.emplace_back(
        extent.cwiseProduct(Eigen::Vector3d(uniform(random), uniform(random), uniform(random))));
  return points;
}

Pose RandomPose(std::mt19937& random) {
  std::normal_distribution<double> normal;
  Pose T = Pose::Identity();
  T.linear() = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                   .normalized()
                   .toRotationMatrix();
  T.translation() = 2.0 * Eigen::Vector3d(normal(random), normal(random), normal(random));
  return T;
}

Points Transformed(const Pose& T_a_b, const Points& points_b) {
  Points points_a;
  for (const Eigen::Vector3d& p : points_b) points_a.push_back(T_a_b * p);
  return points_a;
}

TEST(RigidFitTest, RecoversAnyPoseFromExactPairsOfEveryShape) {
  std::mt19937 random(1);
  // A volume, a plate, a nearly flat plate, a needle with some width, a single triangle.
  const std::vector<std::pair<int, Eigen::Vector3d>> shapes = {{20, {1, 1, 1}},
                                                               {4, {0.05, 0.05, 0}},
                                                               {12, {1, 0.5, 1e-4}},
                                                               {10, {1, 1e-3, 1e-3}},
                                                               {3, {0.1, 0.1, 0.1}}};
  for (const auto& [count, extent] : shapes) {
    for (int trial = 0; trial < 50; ++trial) {
      const Pose T_a_b = RandomPose(random);
      const Points points_b = RandomPoints(random, count, extent);
      const RigidFit fit = FitRigid(Transformed(T_a_b, points_b), points_b);
      ASSERT_TRUE(fit.valid);
      // Rounding of coordinates of some metres over a width of 1 mm: about 1e-15 / 1e-3 in angle,
      // measured 4e-12 at worst.
      EXPECT_LT(RotationAngle(fit.T_a_b.inverse() * T_a_b), 1e-7);
      for (const Eigen::Vector3d& p : points_b) EXPECT_LT((fit.T_a_b * p - T_a_b * p).norm(), 1e-9);
      EXPECT_LT(fit.rms_m, 1e-9);
    }
  }
}

TEST(RigidFitTest, FourCoplanarCornersFarFromTheOriginHaveRankTwoAndAreEnough) {
  Points corners_b = {
      {-0.052, 0.052, 0}, {0.052, 0.052, 0}, {0.052, -0.052, 0}, {-0.052, -0.052, 0}};
  for (Eigen::Vector3d& p : corners_b) p += Eigen::Vector3d(3, -2, 1);
  std::mt19937 random(2);
  const Pose T_a_b = RandomPose(random);
  const RigidFit fit = FitRigid(Transformed(T_a_b, corners_b), corners_b);
  EXPECT_EQ(fit.rank, 2);
  ASSERT_TRUE(fit.valid);
  EXPECT_TRUE(fit.T_a_b.isApprox(T_a_b, 1e-9));
}

TEST(RigidFitTest, RefusesWhatDoesNotDetermineAPose) {
  const Points line = {{0, 0, 1}, {1, 1, 2}, {2, 2, 3}, {5, 5, 6}};
  const RigidFit on_a_line = FitRigid(line, line);
  EXPECT_FALSE(on_a_line.valid);
  EXPECT_EQ(on_a_line.rank, 1);
  EXPECT_TRUE(on_a_line.T_a_b.isApprox(Pose::Identity()));

  const Points same(5, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(FitRigid(same, same).rank, 0);
  EXPECT_FALSE(FitRigid(same, same).valid);

  const Points triangle = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_FALSE(FitRigid(std::span(triangle).first(2), std::span(triangle).first(2)).valid);
  EXPECT_FALSE(FitRigid({}, {}).valid);
  const std::vector<double> two_count = {1, 1, 0};
  EXPECT_FALSE(FitRigid(triangle, triangle, two_count).valid);

  Points damaged = triangle;
  damaged[1].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(FitRigid(damaged, triangle).valid);
}

TEST(RigidFitTest, AMirroredPairingGivesARotationAndALargeResidual) {
  std::mt19937 random(3);
  const Points points_b = RandomPoints(random, 30, {1, 1, 1});
  Points mirrored = points_b;
  for (Eigen::Vector3d& p : mirrored) p.z() = -p.z();
  const RigidFit fit = FitRigid(mirrored, points_b);
  ASSERT_TRUE(fit.valid);
  EXPECT_NEAR(fit.T_a_b.linear().determinant(), 1.0, 1e-12);
  EXPECT_GT(fit.rms_m, 0.1);  // the thinnest axis of a cube of side 2 cannot be mirrored away
}

TEST(RigidFitTest, WeightsAreMultiplicitiesAndZeroLeavesAPairOut) {
  std::mt19937 random(4);
  const Points points_b = RandomPoints(random, 6, {1, 1, 1});
  Points points_a = Transformed(RandomPose(random), points_b);
  std::normal_distribution<double> noise(0, 0.01);
  for (Eigen::Vector3d& p : points_a)
    p += Eigen::Vector3d(noise(random), noise(random), noise(random));

  Points repeated_a = points_a, repeated_b = points_b;
  repeated_a.push_back(points_a[2]);
  repeated_b.push_back(points_b[2]);
  repeated_a.erase(repeated_a.begin());
  repeated_b.erase(repeated_b.begin());
  const std::vector<double> weights = {0, 1, 2, 1, 1, 1};
  const RigidFit weighted = FitRigid(points_a, points_b, weights);
  const RigidFit repeated = FitRigid(repeated_a, repeated_b);
  EXPECT_TRUE(weighted.T_a_b.isApprox(repeated.T_a_b, 1e-12));
  EXPECT_NEAR(weighted.rms_m, repeated.rms_m, 1e-12);
}

TEST(RigidFitTest, NoOtherPoseNearbyHasASmallerResidual) {
  std::mt19937 random(5);
  const Points points_b = RandomPoints(random, 12, {0.5, 0.3, 0.01});
  Points points_a = Transformed(RandomPose(random), points_b);
  std::normal_distribution<double> noise(0, 0.02);
  for (Eigen::Vector3d& p : points_a)
    p += Eigen::Vector3d(noise(random), noise(random), noise(random));
  const RigidFit fit = FitRigid(points_a, points_b);
  std::normal_distribution<double> step(0, 1e-3);
  for (int trial = 0; trial < 200; ++trial) {
    Vector6d twist;
    for (int i = 0; i < 6; ++i) twist[i] = step(random);
    const Pose T_other = PoseFromTwist(twist) * fit.T_a_b;
    double sum = 0;
    for (std::size_t i = 0; i < points_a.size(); ++i)
      sum += (points_a[i] - T_other * points_b[i]).squaredNorm();
    EXPECT_GE(std::sqrt(sum / static_cast<double>(points_a.size())), fit.rms_m - 1e-12);
  }
}

TEST(RigidFitTest, NamesACallersMistake) {
  const Points three = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<double> two_weights = {1, 1};
  const std::vector<double> negative = {1, -1, 1};
  EXPECT_THROW((void)FitRigid(three, std::span(three).first(2)), std::invalid_argument);
  EXPECT_THROW((void)FitRigid(three, three, two_weights), std::invalid_argument);
  EXPECT_THROW((void)FitRigid(three, three, negative), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
