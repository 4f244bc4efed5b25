// SPDX-License-Identifier: Apache-2.0
// A flat table seen from above: where its surface lies and what of a region is missing is known
// from geometry.
#include "daemon/sweep/live_surface.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/synthetic_scene.hpp"

namespace plumb {
namespace {

constexpr Intrinsics kCamera{
    .width = 320, .height = 240, .fx = 260, .fy = 260, .cx = 159.5, .cy = 119.5};
constexpr double kDistance_m = 0.9;
/// Half of what the camera sees of the table along x, where every fourth pixel is taken.
constexpr double kHalf_m = 158.0 / 260 * kDistance_m;

/// The camera looks straight down from x, over a table 0.1 m above the marker. Its world is its
/// first frame's.
TrackingReport SeenFrom(double x_m, bool marker_known) {
  TrackingReport report;
  report.tracked = true;
  report.T_world_camera.translation() = Eigen::Vector3d(x_m, 0, 0);
  if (marker_known) {
    Pose T_scene_world = Pose::Identity();  // camera: x right, y down, z forward
    T_scene_world.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
    T_scene_world.translation() = Eigen::Vector3d(0, 0, kDistance_m + 0.1);
    report.T_scene_world = T_scene_world;
  }
  return report;
}

Frame Table() {
  Frame frame;
  frame.depth_m = cv::Mat(kCamera.height, kCamera.width, CV_32FC1, cv::Scalar(kDistance_m));
  return frame;
}

void LookFrom(LiveSurface& surface, double x_m, bool marker_known = true) {
  for (int i = 0; i < 12; ++i)  // a hand is never still: the points fall into every cell
    surface.Add(Table(), SeenFrom(x_m + 0.004 * i, marker_known));
}

float HeightAt(const LiveSurfaceView& view, double x, double y) {
  return view.heights.z[*view.heights.grid.cell(x, y)];
}

TEST(LiveSurfaceTest, ShowsTheSurfaceWhereItWasSeenAndNowhereElse) {
  LiveSurface surface(kCamera);
  LookFrom(surface, 0.0);
  const auto view = surface.View();
  ASSERT_TRUE(view);
  EXPECT_NEAR(HeightAt(*view, 0.0, 0.0), 0.1, 1e-3);
  EXPECT_NEAR(HeightAt(*view, kHalf_m - 0.05, 0.0), 0.1, 1e-3);
  EXPECT_TRUE(std::isnan(HeightAt(*view, kHalf_m + 0.15, 0.0)));
  EXPECT_FALSE(view->coverage) << "without a region, coverage is not defined";
  EXPECT_TRUE(view->missing.empty());
}

TEST(LiveSurfaceTest, GrowsAndTellsWhatOfTheRegionIsMissing) {
  LiveSurface surface(kCamera);
  std::vector<std::uint8_t> region(surface.grid().num_cells(), 0);
  for (double x = -0.4; x < 1.2; x += 0.02)
    for (double y = -0.2; y < 0.2; y += 0.02) region[*surface.grid().cell(x + 0.01, y + 0.01)] = 1;
  surface.SetRegion(region);
  LookFrom(surface, 0.0);
  const auto first = surface.View();
  // From x = -0.4 to the edge of what is seen, of 1.6 m.
  EXPECT_NEAR(*first->coverage, (kHalf_m + 0.4) / 1.6, 0.05);
  EXPECT_EQ(first->missing[*surface.grid().cell(0.0, 0.0)], 0);
  EXPECT_EQ(first->missing[*surface.grid().cell(1.1, 0.0)], 1);
  EXPECT_EQ(first->missing[*surface.grid().cell(1.1, 0.5)], 0) << "outside the region";
  LookFrom(surface, 0.8);
  const auto second = surface.View();
  EXPECT_GT(*second->coverage, 0.97);
  EXPECT_EQ(second->missing[*surface.grid().cell(1.1, 0.0)], 0);
  EXPECT_EQ(first->missing[*surface.grid().cell(1.1, 0.0)], 1) << "a view does not change";
}

TEST(LiveSurfaceTest, WhatWasSeenBeforeTheReferenceMarkerIsShownOnceThatIsKnown) {
  LiveSurface surface(kCamera);
  LookFrom(surface, 0.0, /*marker_known=*/false);
  EXPECT_FALSE(surface.View());
  surface.Add(Table(), SeenFrom(0.9, true));
  const auto view = surface.View();
  ASSERT_TRUE(view);
  EXPECT_NEAR(HeightAt(*view, -0.4, 0.0), 0.1, 1e-3);
}

TEST(LiveSurfaceTest, WithoutAPoseNothingIsShown) {
  LiveSurface surface(kCamera);
  TrackingReport lost = SeenFrom(0.0, true);
  lost.tracked = false;
  surface.Add(Table(), lost);
  EXPECT_FALSE(surface.View());
}

TEST(LiveSurfaceTest, TheRegionToSeeIsTheBodyOrThePolygonOnIt) {
  const Scene reference = test::MakeSyntheticScene({});
  const LiveSurface surface(kCamera);
  const auto body = RegionToSee(reference, {}, surface.grid());
  ASSERT_EQ(body.size(), surface.grid().num_cells());
  const auto count = [](const std::vector<std::uint8_t>& cells) {
    return std::count(cells.begin(), cells.end(), 1);
  };
  EXPECT_GT(count(body), 20);
  EXPECT_LT(count(body), static_cast<std::ptrdiff_t>(body.size() / 4)) << "not the floor too";
  // Half a plane: what of the body lies in it, and no more.
  const std::vector<Eigen::Vector2d> half = {{0, -2}, {2, -2}, {2, 2}, {0, 2}};
  const auto part = RegionToSee(reference, half, surface.grid());
  EXPECT_GT(count(part), 0);
  for (std::size_t i = 0; i < part.size(); ++i) {
    if (part[i] == 0) continue;
    EXPECT_GE(i % 160, 80U);
  }
  EXPECT_TRUE(RegionToSee(reference, {{5, 5}, {6, 5}, {6, 6}}, surface.grid()).empty());
  EXPECT_TRUE(RegionToSee(Scene{}, {}, surface.grid()).empty());
}

}  // namespace
}  // namespace plumb
