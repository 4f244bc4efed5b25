// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/deviation.hpp"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"

namespace plumb {
namespace {

GridShape Grid() { return {-0.15, -0.15, 0.0015, 200, 200}; }

HeightMap MapOf(const GridShape& grid, const auto& height) {
  HeightMap map(grid);
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      map.z[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.width) +
            static_cast<std::size_t>(column)] =
          static_cast<float>(height(grid.x_centre(column), grid.y_centre(row)));
    }
  }
  return map;
}

// A dome of radius 0.2 m that reaches z = 0.1 m at (cx, 0); all of the grid lies on it, slopes up
// to 45 degrees.
auto Dome(double cx, double radius = 0.2) {
  return [=](double x, double y) {
    return 0.1 - 0.2 + std::sqrt(radius * radius - (x - cx) * (x - cx) - y * y);
  };
}

TEST(DeviationTest, DifferenceIsCurrentMinusReferenceWhereBothAreKnown) {
  HeightMap reference = MapOf(Grid(), [](double, double) { return 0.1; });
  HeightMap current = MapOf(Grid(), [](double, double) { return 0.107; });
  reference.z[5] = std::nanf("");
  current.z[6] = std::nanf("");
  const HeightMap difference = HeightDifference(current, reference);
  EXPECT_NEAR(difference.z[0], 0.007, 1e-6);
  EXPECT_TRUE(std::isnan(difference.z[5]));
  EXPECT_TRUE(std::isnan(difference.z[6]));
  EXPECT_THROW((void)HeightDifference(HeightMap(GridShape{}), reference), std::invalid_argument);
}

TEST(DeviationTest, DistanceToALargerSphereIsTheDifferenceOfRadiiEverywhere) {
  const HeightMap reference = MapOf(Grid(), Dome(0));
  for (const double more : {0.0005, 0.004, 0.02, -0.02, -0.004}) {
    const HeightMap current = MapOf(Grid(), Dome(0, 0.2 + more));
    const HeightMap distance = SignedDistance(current, reference);
    double worst = 0;
    int count = 0;
    for (int row = 30; row < 170; ++row) {
      for (int column = 30; column < 170; ++column) {
        ASSERT_TRUE(std::isfinite(distance.at(row, column)));
        worst = std::max(worst, std::abs(distance.at(row, column) - more));
        ++count;
      }
    }
    // Chords of 1.5 mm cells on a 0.2 m sphere: 1.4e-6 m; measured worst 1.5e-5 m.
    EXPECT_LT(worst, 5e-5) << more;
  }
}

TEST(DeviationTest, ASidewaysShiftIsMeasuredAsDistanceNotAsHeight) {
  // 10 mm sideways: at 45 degrees of slope heights differ by 10 mm and more, distances by at most
  // 10 sin(slope).
  const HeightMap reference = MapOf(Grid(), Dome(0));
  const HeightMap current = MapOf(Grid(), Dome(0.010));
  const HeightMap distance = SignedDistance(current, reference);
  const GridShape grid = Grid();
  for (int row = 40; row < 160; row += 3) {
    for (int column = 40; column < 160; column += 3) {
      const Eigen::Vector3d p(grid.x_centre(column), grid.y_centre(row), reference.at(row, column));
      // Truth: the current surface is a sphere about (0.01, 0, -0.1).
      const double expected = 0.2 - (p - Eigen::Vector3d(0.010, 0, -0.1)).norm();
      EXPECT_NEAR(distance.at(row, column), expected, 5e-5);  // measured worst 1.6e-5
    }
  }
}

TEST(DeviationTest, DistanceEndsWhereTheCurrentSurfaceEnds) {
  const HeightMap reference = MapOf(Grid(), [](double, double) { return 0.0; });
  const HeightMap current =
      MapOf(Grid(), [](double x, double) { return x < 0 ? 0.003 : std::nan(""); });
  const HeightMap distance = SignedDistance(current, reference);
  EXPECT_NEAR(distance.at(100, 50), 0.003, 1e-6);
  EXPECT_TRUE(std::isnan(distance.at(100, 150)));
}

TEST(DeviationTest, MaskLimitsTheDistance) {
  const HeightMap reference = MapOf(Grid(), [](double, double) { return 0.0; });
  const HeightMap current = MapOf(Grid(), [](double, double) { return 0.01; });
  std::vector<std::uint8_t> mask(reference.z.size(), 0);
  mask[20100] = 1;
  const HeightMap distance = SignedDistance(current, reference, mask);
  EXPECT_NEAR(distance.z[20100], 0.01, 1e-6);
  EXPECT_TRUE(std::isnan(distance.z[20101]));
  mask.pop_back();
  EXPECT_THROW((void)SignedDistance(current, reference, mask), std::invalid_argument);
}

TEST(DeviationTest, ResamplingMovesTheSurfaceAndLeavesNoPinholes) {
  const HeightMap source = MapOf(Grid(), Dome(0));
  const Pose T(Eigen::Translation3d(0.0107, -0.0063, 0.002) *
               Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) *
               Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitX()));
  const HeightMap moved = ResampledHeightMap(source, T, Grid());
  const Eigen::Vector3d centre = T * Eigen::Vector3d(0, 0, -0.1);
  const GridShape grid = Grid();
  for (int row = 60; row < 140; ++row) {
    for (int column = 60; column < 140; ++column) {
      ASSERT_TRUE(std::isfinite(moved.at(row, column))) << row << " " << column;
      const Eigen::Vector3d p(grid.x_centre(column), grid.y_centre(row), moved.at(row, column));
      EXPECT_NEAR((p - centre).norm(), 0.2, 1e-5);  // chords of the cells: 2.8e-6
    }
  }
}

TEST(DeviationTest, ResamplingDrawsNoSheetAcrossAJumpAndKeepsTheHigherSurface) {
  const HeightMap source = MapOf(Grid(), [](double x, double) { return x < 0 ? 0.0 : 0.1; });
  const HeightMap moved =
      ResampledHeightMap(source, Pose(Eigen::Translation3d(0.0002, 0.0002, 0)), Grid());
  for (const float z : moved.z) {
    EXPECT_TRUE(std::isnan(z) || std::abs(z) < 1e-6 || std::abs(z - 0.1F) < 1e-6) << z;
  }
  // Tipped upright, two sheets lie over one another: the upper one is seen.
  const HeightMap ramp = MapOf(Grid(), [](double x, double) { return 0.5 * x; });
  const HeightMap turned =
      ResampledHeightMap(ramp, Pose(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY())), Grid());
  EXPECT_TRUE(std::isfinite(turned.at(100, 100)));
}

TEST(DeviationTest, ACloudAloneMakesAHeightMap) {
  PointCloud cloud;
  const auto dome = Dome(0);
  for (double x = -0.12; x < 0.12; x += 0.003) {
    for (double y = -0.12; y < 0.12; y += 0.003) {
      const Eigen::Vector3d p(x, y, dome(x, y));
      cloud.points.push_back(p.cast<float>());
      cloud.normals.push_back((p - Eigen::Vector3d(0, 0, -0.1)).normalized().cast<float>());
      cloud.points.emplace_back(x, y,
                                p.z() - 0.05);  // a second surface below must not pull it down
      cloud.normals.emplace_back(0, 0, 1);
    }
  }
  const GridShape grid = Grid();
  const HeightMap map = HeightMapOfCloud(cloud, 0.004, grid);
  for (int row = 40; row < 160; ++row) {
    for (int column = 40; column < 160; ++column) {
      ASSERT_TRUE(std::isfinite(map.at(row, column)));
      EXPECT_NEAR(map.at(row, column), dome(grid.x_centre(column), grid.y_centre(row)),
                  6e-5);  // discs of 4 mm on 0.2 m: 4e-5
    }
  }
}

}  // namespace
}  // namespace plumb
