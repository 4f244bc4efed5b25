// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/plan_doubts.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(PlanDoubtsTest, AnIsocentreIsAsFarAwayAsTheNearestOfTheSurface) {
  Scene scene;
  EXPECT_EQ(IsocentreAway_m(scene, {7, 8, 9}), 0.0) << "no surface to measure from";
  HeightMap& map = scene.height_map.emplace(
      GridShape{.x_min = 0, .y_min = 0, .step = 0.1, .width = 4, .height = 3});
  EXPECT_TRUE(std::isinf(IsocentreAway_m(scene, {0, 0, 0})));
  map.at(1, 2) = 0.3F;  // at x 0.25, y 0.15
  EXPECT_NEAR(IsocentreAway_m(scene, {0.25, 0.15, 0.8}), 0.5, 1e-6);
  EXPECT_NEAR(IsocentreAway_m(scene, {0.25 + 0.3, 0.15 + 0.4, 0.3}), 0.5, 1e-6);
  map.at(0, 0) = 0.0F;
  EXPECT_NEAR(IsocentreAway_m(scene, {0.05, 0.05, -0.2}), 0.2, 1e-6);
}

}  // namespace
}  // namespace plumb
