// SPDX-License-Identifier: Apache-2.0
#include "algo/geometry/packed_normal.hpp"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

TEST(PackedNormalTest, EveryDirectionComesBack) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  double farthest_rad = 0;
  const auto check = [&](const Eigen::Vector3f& direction) {
    const Eigen::Vector3f back = PackedNormal(direction.normalized()).Unit();
    EXPECT_NEAR(back.norm(), 1.0F, 1e-6F);
    farthest_rad = std::max<double>(farthest_rad, (back - direction.normalized()).norm());
  };
  for (int i = 0; i < 100000; ++i) check({normal(random), normal(random), normal(random)});
  for (const float x : {-1.0F, 0.0F, 1.0F})  // Axes, edges and corners of the octahedron.
    for (const float y : {-1.0F, 0.0F, 1.0F})
      for (const float z : {-1.0F, 0.0F, 1.0F})
        if (x != 0 || y != 0 || z != 0) check({x, y, z});
  EXPECT_LT(farthest_rad, 0.004 * kDegree);
  EXPECT_GT(farthest_rad, 0.001 * kDegree);
}

}  // namespace
}  // namespace plumb
