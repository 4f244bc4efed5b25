// SPDX-License-Identifier: Apache-2.0
#include "algo/published/poisson_disk.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

namespace plumb {
namespace {

std::vector<Eigen::Vector3f> RandomCloud(std::size_t count, const Eigen::Vector3f& extent,
                                         unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-0.5F, 0.5F);
  std::vector<Eigen::Vector3f> points(count);
  for (Eigen::Vector3f& p : points)
    p = extent.cwiseProduct(Eigen::Vector3f(uniform(random), uniform(random), uniform(random)));
  return points;
}

// The two halves of the definition, each by looking at every pair.
TEST(PoissonDiskTest, KeptPointsKeepTheirDistanceAndEveryPointHasAKeptOneNear) {
  for (const Eigen::Vector3f& extent :
       {Eigen::Vector3f(0.4F, 0.4F, 0.0F), Eigen::Vector3f(0.2F, 0.2F, 0.2F),
        Eigen::Vector3f(3.0F, 0.0F, 0.0F)}) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      const float spacing = 0.02F;
      const auto points = RandomCloud(4000, extent, seed);
      const auto kept = PoissonDiskSubset(points, spacing, seed);
      ASSERT_FALSE(kept.empty());
      for (std::size_t i = 0; i < kept.size(); ++i)
        for (std::size_t k = i + 1; k < kept.size(); ++k)
          EXPECT_GE((points[kept[i]] - points[kept[k]]).norm(), spacing * (1 - 1e-6F));
      for (const Eigen::Vector3f& p : points) {
        float nearest = std::numeric_limits<float>::max();
        for (const std::uint32_t i : kept) nearest = std::min(nearest, (points[i] - p).norm());
        EXPECT_LT(nearest, spacing);
      }
    }
  }
}

TEST(PoissonDiskTest, VisitsInARandomOrder) {
  // Dense points on a line: random sequential packing keeps 0.7476 of the most that fit (Renyi's
  // parking constant); a sweep in memory order would keep nearly 1.
  std::vector<Eigen::Vector3f> line(200000);
  for (std::size_t i = 0; i < line.size(); ++i)
    line[i] = Eigen::Vector3f(10.0F * static_cast<float>(i) / 200000.0F, 0, 0);
  const auto kept = PoissonDiskSubset(line, 0.02, 5);
  // Standard deviation of the share for 500 sites: sqrt(0.038 / 500) = 0.009; limit four of them.
  EXPECT_NEAR(static_cast<double>(kept.size()) / 500.0, 0.7476, 0.035);
}

TEST(PoissonDiskTest, TheSeedAndNothingElseDecides) {
  const auto points = RandomCloud(3000, {0.5F, 0.5F, 0.1F}, 9);
  EXPECT_EQ(PoissonDiskSubset(points, 0.03, 4), PoissonDiskSubset(points, 0.03, 4));
  EXPECT_NE(PoissonDiskSubset(points, 0.03, 4), PoissonDiskSubset(points, 0.03, 5));
}

TEST(PoissonDiskTest, SpacingZeroKeepsAllAndCoincidentPointsLeaveOne) {
  const auto points = RandomCloud(100, {1, 1, 1}, 2);
  EXPECT_EQ(PoissonDiskSubset(points, 0.0, 1).size(), 100U);
  const std::vector<Eigen::Vector3f> same(50, Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(PoissonDiskSubset(same, 0.01, 1).size(), 1U);
  EXPECT_TRUE(PoissonDiskSubset({}, 0.01, 1).empty());
}

TEST(PoissonDiskTest, NamesACallersMistake) {
  std::vector<Eigen::Vector3f> points(3, Eigen::Vector3f::Zero());
  EXPECT_THROW((void)PoissonDiskSubset(points, -0.01, 1), std::invalid_argument);
  EXPECT_THROW((void)PoissonDiskSubset(points, std::nan(""), 1), std::invalid_argument);
  points[1].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW((void)PoissonDiskSubset(points, 0.01, 1), std::invalid_argument);
  points[1].y() = 1e30F;
  EXPECT_THROW((void)PoissonDiskSubset(points, 0.01, 1), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
