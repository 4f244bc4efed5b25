// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/contour_surface.hpp"

#include <time.h>

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

TEST(ContourSurfaceTest, SlicesAreMissingWhereAFewStepsAreLongerThanThoseBesideThem) {
  const auto found = [](const std::vector<double>& steps) {
    std::vector<std::size_t> at;
    const std::vector<bool> missing = MissingWithin(steps);
    for (std::size_t i = 0; i < missing.size(); ++i)
      if (missing[i]) at.push_back(i);
    return at;
  };
  using At = std::vector<std::size_t>;
  EXPECT_EQ(found({5, 5, 7.4, 5, 5}), At());
  EXPECT_EQ(found({5, 5, 7.6, 5, 5}), At({2}));
  EXPECT_EQ(found({5, 10, 10, 5, 5}), At({1, 2})) << "two, each alone";
  EXPECT_EQ(found({5, 10, 5, 15, 5}), At({1, 3}));
  EXPECT_EQ(found({3, 3, 3, 5, 5, 5}), At()) << "two spacings";
  EXPECT_EQ(found({5, 5, 3, 3, 3, 5, 5, 5}), At());
  EXPECT_EQ(found({3, 3, 5, 5, 5, 5, 3, 3}), At());
  EXPECT_EQ(found({3, 3, 5, 5, 10, 5, 5}), At({4})) << "missing in the wider part";
  EXPECT_EQ(found({3, 3, 8, 5, 5}), At({2})) << "missing where they meet";
  EXPECT_EQ(found({10, 5, 5, 5}), At({0}));
  EXPECT_EQ(found({5, 5, 5, 10}), At({3}));
  EXPECT_EQ(found({5}), At());
  EXPECT_EQ(found({}), At());
}

// A contour that runs to and fro, each time across all columns.
std::vector<ContourSlice> ToAndFro(int times) {
  FlatContour contour = {{-0.2, -0.1}, {0.2, -0.1}, {0.2, 0.0}};
  for (int i = 2; i < times; ++i) contour.emplace_back(i % 2 == 0 ? -0.2 : 0.2, 0.002 * i);
  return {{0.0, {contour}}, {0.003, {contour}}, {0.006, {contour}}, {0.009, {contour}}};
}

TEST(ContourSurfaceTest, ContoursThatWouldTakeAllMemoryOrMinutesAreRefused) {
  EXPECT_NO_THROW((void)SurfaceFromAbove(ToAndFro(48)));
  EXPECT_THROW((void)SurfaceFromAbove(ToAndFro(54)), RaggedContours);
  for (const int parts : {499, 500}) {
    std::vector<ContourSlice> slices = Cylinder();
    for (int i = 0; i < parts; ++i)
      slices[20].contours.push_back(Box(0.4 + 0.03 * i, 0.42 + 0.03 * i, 0.1, 0.12));
    if (parts == 499)
      EXPECT_EQ(SurfaceFromAbove(std::move(slices)).parts_apart, 499U);
    else
      EXPECT_THROW((void)SurfaceFromAbove(std::move(slices)), RaggedContours);
  }
  for (const int places : {10'000, 10'001}) {
    std::vector<ContourSlice> slices;
    for (int i = 0; i < places; ++i) slices.push_back({1e-4 * i, {Box(0, 0.02, 0, 0.02)}});
    if (places == 10'000)
      EXPECT_NO_THROW((void)SurfaceFromAbove(std::move(slices)));
    else
      EXPECT_THROW((void)SurfaceFromAbove(std::move(slices)), RaggedContours);
  }
}

TEST(ContourSurfaceTest, ContoursThatStayAtOnePlaceTakeNoLonger) {
  constexpr std::size_t kPoints = 100'000;
  std::vector<ContourSlice> slices = Cylinder();
  for (ContourSlice& slice : slices) slice.contours.front() = Box(-0.15, 0.15, 0, 0.3);
  for (const double end : {0.31, 0.32}) {
    FlatContour still(kPoints, Eigen::Vector2d(0.25, 0.3));
    still.emplace_back(0.2, end);
    still.emplace_back(0.2, 0.3);
    slices[20].contours.push_back(std::move(still));
  }
  timespec begun{}, ended{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &begun);
  const ContourSurface surface = SurfaceFromAbove(std::move(slices));
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &ended);
  EXPECT_EQ(surface.repeated, 0U);
#ifdef NDEBUG
  // Measured: 0.05 s; each with each point takes 5 s and more.
  EXPECT_LT(static_cast<double>(ended.tv_sec - begun.tv_sec) +
                1e-9 * static_cast<double>(ended.tv_nsec - begun.tv_nsec),
            2.0);
#endif
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
