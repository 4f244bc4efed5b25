// SPDX-License-Identifier: Apache-2.0
#include "algo/base/polygon.hpp"

#include <vector>

#include <gtest/gtest.h>

namespace plumb {
namespace {

using Polygon = std::vector<Eigen::Vector2d>;

TEST(PolygonTest, ABowTieCrossesItself) {
  EXPECT_EQ(CrossingEdges(Polygon{{0, 0}, {1, 1}, {1, 0}, {0, 1}}), (std::pair{0UL, 2UL}));
  EXPECT_EQ(CrossingEdges(Polygon{{0, 0}, {2, 0}, {2, 2}, {1, -1}, {0, 2}}), (std::pair{0UL, 2UL}));
}

TEST(PolygonTest, ConvexHollowAndTouchingOutlinesDoNot) {
  EXPECT_FALSE(CrossingEdges(Polygon{{0, 0}, {1, 0}, {1, 1}, {0, 1}}));
  EXPECT_FALSE(CrossingEdges(Polygon{{0, 0}, {2, 0}, {2, 2}, {1, 0.1}, {0, 2}}));
  EXPECT_FALSE(CrossingEdges(Polygon{{0, 0}, {2, 0}, {2, 2}, {1, 0}, {0, 2}})) << "it touches";
  EXPECT_FALSE(CrossingEdges(Polygon{{0, 0}, {1, 0}, {1, 1}}));
  EXPECT_FALSE(CrossingEdges(Polygon{}));
}

}  // namespace
}  // namespace plumb
