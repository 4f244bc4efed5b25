// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/contour_surface.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "algo/base/statistics.hpp"

namespace plumb {
namespace {

constexpr double kRadius_m = 0.15, kCentre_m = 0.15;  // it lies on z = 0

FlatContour Circle(double x, double z, double radius, int points = 720) {
  FlatContour contour;
  for (int i = 0; i < points; ++i) {
    const double angle = 2 * std::numbers::pi * i / points;
    contour.emplace_back(x + radius * std::cos(angle), z + radius * std::sin(angle));
  }
  return contour;
}

FlatContour Box(double x_low, double x_high, double z_low, double z_high) {
  return {{x_low, z_low}, {x_high, z_low}, {x_high, z_high}, {x_low, z_high}};
}

// A cylinder along y from 0 to 0.3 m.
std::vector<ContourSlice> Cylinder(double spacing_m = 3 * kMillimetre) {
  std::vector<ContourSlice> slices;
  for (int i = 0; i * spacing_m <= 0.3; ++i)
    slices.push_back({i * spacing_m, {Circle(0, kCentre_m, kRadius_m)}});
  return slices;
}

// The height at a place; NaN where nothing is known.
double HeightAt(const ContourSurface& surface, double x, double y) {
  const auto cell = surface.heights.grid.cell(x, y);
  return cell ? surface.heights.z[*cell] : std::nan("");
}

TEST(ContourSurfaceTest, TheTopOfACylinderHasItsHeight) {
  const ContourSurface surface = SurfaceFromAbove(Cylinder());
  const GridShape& grid = surface.heights.grid;
  int known = 0;
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      const float z = surface.heights.at(row, column);
      if (!std::isfinite(z)) continue;
      ++known;
      const double x = grid.x_centre(column);
      EXPECT_NEAR(z, kCentre_m + std::sqrt(kRadius_m * kRadius_m - x * x), 1e-5);
    }
  }
  EXPECT_GT(known, 15000);
  EXPECT_NEAR(surface.support_m, 0.0, 1e-6);
  EXPECT_NEAR(surface.spacing_m, 0.003, 1e-9);
}

TEST(ContourSurfaceTest, FlanksAndTheEndsOfTheScanAreLeftOut) {
  const ContourSurface surface = SurfaceFromAbove(Cylinder());
  EXPECT_TRUE(std::isnan(HeightAt(surface, 0.1495, 0.15))) << "steeper than 10 mm in 2 mm";
  EXPECT_TRUE(std::isnan(HeightAt(surface, 0, 0.001))) << "before the second slice";
  EXPECT_TRUE(std::isnan(HeightAt(surface, 0, 0.299))) << "behind the last but one";
  EXPECT_FALSE(std::isnan(HeightAt(surface, 0, 0.005)));
}

TEST(ContourSurfaceTest, BetweenSlicesHeightsAreInterpolated) {
  // A cone: its radius shrinks along y.
  std::vector<ContourSlice> slices;
  for (int i = 0; i <= 60; ++i) slices.push_back({i * 0.005, {Circle(0, 0.15, 0.15 - 0.001 * i)}});
  const ContourSurface surface = SurfaceFromAbove(std::move(slices));
  const GridShape& grid = surface.heights.grid;
  const int column = static_cast<int>((0.0 - grid.x_min) / grid.step);
  for (int row = 10; row < 100; ++row) {
    const double radius = 0.15 - 0.2 * grid.y_centre(row), x = grid.x_centre(column);
    EXPECT_NEAR(surface.heights.at(row, column), 0.15 + std::sqrt(radius * radius - x * x), 1e-5);
  }
}

TEST(ContourSurfaceTest, TheFirstContourOfASliceIsNotTheBody) {
  std::vector<ContourSlice> slices = Cylinder();
  for (ContourSlice& slice : slices)
    slice.contours.insert(slice.contours.begin(), Circle(-0.30, 0.25, 0.004));
  const ContourSurface surface = SurfaceFromAbove(std::move(slices));
  EXPECT_EQ(surface.crumbs, 101U);
  EXPECT_TRUE(std::isnan(HeightAt(surface, -0.30, 0.15))) << "50 mm2 are a crumb";
  EXPECT_NEAR(HeightAt(surface, 0, 0.15), 0.3, 1e-4);
}

TEST(ContourSurfaceTest, AContourThatASliceHasTwiceIsNoHoleInItself) {
  const ContourSurface once = SurfaceFromAbove(Cylinder());
  std::vector<ContourSlice> slices = Cylinder();
  for (std::size_t i = 0; i < slices.size(); ++i) {
    // The same points, begun elsewhere and, in every second slice, the other way round.
    FlatContour again = slices[i].contours.front();
    std::rotate(again.begin(), again.begin() + 7, again.end());
    if (i % 2 == 0) std::reverse(again.begin(), again.end());
    slices[i].contours.push_back(std::move(again));
  }
  const ContourSurface twice = SurfaceFromAbove(std::move(slices));
  EXPECT_EQ(twice.repeated, 101U);
  EXPECT_EQ(once.repeated, 0U);
  EXPECT_EQ(twice.holes, 0U);
  EXPECT_EQ(twice.parts_apart, 0U);
  EXPECT_NEAR(HeightAt(twice, 0, 0.15), 0.3, 1e-4);
  EXPECT_NEAR(HeightAt(twice, 0.1, 0.15), HeightAt(once, 0.1, 0.15), 1e-6);
}

TEST(ContourSurfaceTest, ArmsApartAreKeptAndPartsOfTheCouchAreNot) {
  std::vector<ContourSlice> slices = Cylinder();
  for (ContourSlice& slice : slices) {
    slice.contours.push_back(Circle(0.25, 0.06, 0.05));
    slice.contours.push_back(Box(-0.25, -0.19, 0.0, 0.012));
  }
  const ContourSurface surface = SurfaceFromAbove(std::move(slices));
  EXPECT_EQ(surface.parts_apart, 101U);
  EXPECT_EQ(surface.couch_parts, 101U);
  EXPECT_NEAR(HeightAt(surface, 0.25, 0.15), 0.11, 2e-4);
  EXPECT_TRUE(std::isnan(HeightAt(surface, -0.22, 0.15)));
}

TEST(ContourSurfaceTest, WhatIsAsLowAsTheCouchIsMaskedEvenWithinTheLargestContour) {
  std::vector<ContourSlice> slices;
  // A body and the couch beside it, drawn as one contour.
  for (int i = 0; i <= 60; ++i)
    slices.push_back({i * 0.003,
                      {{{-0.3, 0},
                        {0.3, 0},
                        {0.3, 0.01},
                        {0.1, 0.01},
                        {0.05, 0.2},
                        {-0.05, 0.2},
                        {-0.1, 0.01},
                        {-0.3, 0.01}}}});
  const ContourSurface surface = SurfaceFromAbove(std::move(slices));
  EXPECT_TRUE(std::isnan(HeightAt(surface, 0.2, 0.09)));
  EXPECT_NEAR(HeightAt(surface, 0.0, 0.09), 0.2, 1e-5);
}

TEST(ContourSurfaceTest, HolesAndKeyholesDoNotChangeTheTop) {
  std::vector<ContourSlice> holes = Cylinder(), keyholes = Cylinder();
  for (ContourSlice& slice : holes) slice.contours.push_back(Circle(0, 0.1, 0.03));
  for (ContourSlice& slice : keyholes) {
    // From the top there and back to an inner circle, which turns the other way.
    FlatContour& outer = slice.contours.front();
    FlatContour inner = Circle(0, 0.1, 0.03);
    const auto top = outer.begin() + static_cast<std::ptrdiff_t>(outer.size() / 4);
    FlatContour keyhole(outer.begin(), top + 1);
    for (std::size_t i = 0; i <= inner.size(); ++i)
      keyhole.push_back(inner[(inner.size() / 4 + inner.size() - i) % inner.size()]);
    keyhole.insert(keyhole.end(), top, outer.end());
    outer = keyhole;
  }
  const ContourSurface hole = SurfaceFromAbove(std::move(holes));
  const ContourSurface keyhole = SurfaceFromAbove(std::move(keyholes));
  EXPECT_EQ(hole.holes, 101U);
  EXPECT_EQ(hole.parts_apart, 0U);
  for (const ContourSurface* surface : {&hole, &keyhole}) {
    for (const double x : {-0.06, -0.02, 0.0, 0.001, 0.02, 0.06})
      EXPECT_NEAR(HeightAt(*surface, x, 0.15), 0.15 + std::sqrt(0.0225 - x * x), 1e-3) << x;
  }
}

TEST(ContourSurfaceTest, AMissingSliceIsNotBridged) {
  std::vector<ContourSlice> slices = Cylinder();
  slices.erase(slices.begin() + 50);
  const ContourSurface surface = SurfaceFromAbove(std::move(slices));
  EXPECT_EQ(surface.gaps, 1U);
  EXPECT_TRUE(std::isnan(HeightAt(surface, 0, 0.150)));
  EXPECT_FALSE(std::isnan(HeightAt(surface, 0, 0.145)));
  EXPECT_FALSE(std::isnan(HeightAt(surface, 0, 0.155)));
}

TEST(ContourSurfaceTest, SlicesMayComeInAnyOrderAndContourByContour) {
  std::vector<ContourSlice> slices = Cylinder();
  for (ContourSlice& slice : slices) slice.contours.push_back(Circle(0.25, 0.06, 0.05));
  std::vector<ContourSlice> shuffled;
  for (std::size_t i = slices.size(); i > 0; --i) {
    for (const FlatContour& contour : slices[i - 1].contours)
      shuffled.push_back({slices[i - 1].y_m, {contour}});
  }
  const ContourSurface a = SurfaceFromAbove(std::move(slices));
  const ContourSurface b = SurfaceFromAbove(std::move(shuffled));
  ASSERT_EQ(a.heights.grid, b.heights.grid);
  for (std::size_t i = 0; i < a.heights.z.size(); ++i) {
    ASSERT_EQ(std::isfinite(a.heights.z[i]), std::isfinite(b.heights.z[i]));
    if (std::isfinite(a.heights.z[i])) {
      ASSERT_EQ(a.heights.z[i], b.heights.z[i]);
    }
  }
}

TEST(ContourSurfaceTest, AStraightSideIsTheEdgeOfTheFieldOfView) {
  std::vector<ContourSlice> slices = Cylinder();
  for (ContourSlice& slice : slices) {
    for (Eigen::Vector2d& p : slice.contours.front()) p.x() = std::min(p.x(), 0.12);
  }
  const ContourSurface surface = SurfaceFromAbove(std::move(slices));
  EXPECT_TRUE(surface.cut_at_side);
  EXPECT_TRUE(std::isnan(HeightAt(surface, 0.110, 0.15)));
  EXPECT_FALSE(std::isnan(HeightAt(surface, 0.090, 0.15)));
  EXPECT_FALSE(std::isnan(HeightAt(surface, -0.110, 0.15))) << "the other side is whole";
  EXPECT_FALSE(SurfaceFromAbove(Cylinder()).cut_at_side);
}

TEST(ContourSurfaceTest, TooLittleIsRefused) {
  EXPECT_THROW((void)SurfaceFromAbove({}), std::invalid_argument);
  EXPECT_THROW((void)SurfaceFromAbove({{0.0, {Circle(0, 0, 0.1)}}, {0.003, {}}, {0.006, {}}}),
               std::invalid_argument);
}

}  // namespace
}  // namespace plumb
