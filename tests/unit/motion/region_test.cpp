// SPDX-License-Identifier: Apache-2.0
#include "algo/motion/region.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"
#include "tests/support/synthetic_scene.hpp"

namespace plumb {
namespace {

using test::BodyCentroid;
using test::BodyShape;
using test::MakeSyntheticScene;
using test::SyntheticOptions;

SyntheticOptions Lying(BodyShape shape = BodyShape::kTorso) {
  SyntheticOptions options;
  options.shape = shape;
  options.T_reference_body =
      Pose(Eigen::Translation3d(shape == BodyShape::kFullBody ? 1.05 : 0.6, 0.45, 0.0));
  return options;
}

// The scene of most tests here.
const Scene& Torso() {
  static const Scene scene = MakeSyntheticScene(Lying());
  return scene;
}

Body FindIn(const Scene& scene) { return FindBody(MakeSurface(scene.cloud, 0.01, 0.03)); }

// Area of the mask and of the same map's cells that the formula puts above the cut.
double MaskArea_m2(const HeightMap& map, const std::vector<std::uint8_t>& mask) {
  return static_cast<double>(std::count(mask.begin(), mask.end(), 1)) * map.grid.step *
         map.grid.step;
}

TEST(RegionTest, ATorsoOnTheFloorStandsOnTheFloor) {
  const Scene& scene = Torso();
  const Body body = FindIn(scene);
  ASSERT_TRUE(body.support);
  EXPECT_NEAR(body.support->offset_m, 0.0, 1e-4);
  EXPECT_GT(body.support->normal.z(), 0.99999);
  std::size_t above = 0;
  for (const float z : scene.height_map->z) above += z > 0.025F ? 1 : 0;
  const std::vector<std::uint8_t> mask = RegionMask(*scene.height_map, body, {});
  // Everything over the cut is the body; cells of the outline may be lost at its rim: measured 0.2
  // %.
  const double truth_m2 = static_cast<double>(above) * 0.0015 * 0.0015;
  EXPECT_NEAR(MaskArea_m2(*scene.height_map, mask) / truth_m2, 1.0, 0.01);
}

TEST(RegionTest, ABodyOnACouchStandsOnTheCouchNotOnTheFloorBelow) {
  for (const BodyShape shape : {BodyShape::kTorso, BodyShape::kFullBody}) {
    SyntheticOptions options = Lying(shape);
    options.couch = true;
    const Body body = FindIn(MakeSyntheticScene(options));
    ASSERT_TRUE(body.support);
    EXPECT_NEAR(body.support->offset_m, 0.0, 5e-4);
  }
}

TEST(RegionTest, ATiltedFrameAndANoisyFloorDoNotMatter) {
  SyntheticOptions options = Lying();
  options.noise_m = 0.002;
  Scene scene = MakeSyntheticScene(options);
  const Pose T(Eigen::AngleAxisd(4 * kDegree, Eigen::Vector3d(1, 1, 0).normalized()));
  const Body body = FindBody(MakeSurface(TransformedCloud(T, scene.cloud), 0.01, 0.03));
  ASSERT_TRUE(body.support);
  // 2 mm of noise in 1 cm patches over 1.5 m: measured 0.02 deg.
  EXPECT_LT(std::acos(std::min(1.0, body.support->normal.dot(T.linear().col(2)))), 0.1 * kDegree);
  EXPECT_TRUE(body.Contains(T * Eigen::Vector3d(0.6, 0.45, 0.2)));
  EXPECT_FALSE(body.Contains(T * Eigen::Vector3d(0.6, 0.45, 0.01)));
  EXPECT_FALSE(body.Contains(T * Eigen::Vector3d(0.05, 0.05, 0.05)));
}

TEST(RegionTest, ASmallerThingBesideTheBodyIsNotTheBody) {
  Scene scene = Torso();
  for (double x = 0.0; x < 0.15; x += 0.003) {
    for (double y = 0.7; y < 0.85; y += 0.003) {
      scene.cloud.points.emplace_back(x, y, 0.1);
      scene.cloud.normals.emplace_back(0, 0, 1);
    }
  }
  const Body body = FindIn(scene);
  EXPECT_TRUE(body.Contains({0.6, 0.45, 0.2}));
  EXPECT_FALSE(body.Contains({0.07, 0.77, 0.1}));
}

TEST(RegionTest, WithoutAnyFloorAllIsBody) {
  PointCloud cloud;
  for (double x = 0; x < 0.2; x += 0.003) {
    for (double y = 0; y < 0.2; y += 0.003) {
      const Eigen::Vector3d p(x, y,
                              std::sqrt(0.04 - (x - 0.1) * (x - 0.1) - (y - 0.1) * (y - 0.1)));
      cloud.points.push_back(p.cast<float>());
      cloud.normals.push_back((p - Eigen::Vector3d(0.1, 0.1, 0)).normalized().cast<float>());
    }
  }
  const Body body = FindBody(MakeSurface(cloud, 0.01, 0.03));
  EXPECT_FALSE(body.support);
  EXPECT_TRUE(body.Contains({0.1, 0.1, 0.2}));
}

TEST(RegionTest, EmptyAndDamagedCloudsAreNoBody) {
  EXPECT_FALSE(FindBody(MakeSurface({}, 0.01, 0.03)).Contains({0, 0, 0}));
  PointCloud cloud;
  cloud.points.assign(100, Eigen::Vector3f::Constant(std::nanf("")));
  cloud.points.emplace_back(1e30F, 0, 0);
  cloud.normals.assign(101, Eigen::Vector3f::UnitZ());
  EXPECT_FALSE(FindBody(MakeSurface(cloud, 0.01, 0.03)).Contains({0, 0, 0}));
}

TEST(RegionTest, APolygonTakesThePartOfTheBodyInside) {
  const Scene& scene = Torso();
  const Body body = FindIn(scene);
  const std::vector<std::uint8_t> mask =
      RegionMask(*scene.height_map, body, {{0.5, 0.0}, {0.7, 0.0}, {0.7, 0.9}, {0.5, 0.9}});
  const GridShape& grid = scene.height_map->grid;
  EXPECT_EQ(mask[*grid.cell(0.6, 0.45)], 1);
  EXPECT_EQ(mask[*grid.cell(0.75, 0.45)], 0);  // body, outside
  EXPECT_EQ(mask[*grid.cell(0.6, 0.02)], 0);   // floor, inside
  // On bare floor the polygon means the floor.
  const std::vector<std::uint8_t> floor =
      RegionMask(*scene.height_map, body, {{0.0, 0.0}, {0.1, 0.0}, {0.1, 0.1}, {0.0, 0.1}});
  EXPECT_NEAR(MaskArea_m2(*scene.height_map, floor), 0.01, 2e-4);
}

TEST(RegionTest, CoverageCountsWhatTheCurrentScanMeasuredAndFindsTheHole) {
  const SyntheticOptions options = Lying();
  const Scene& reference = Torso();
  const std::vector<std::uint8_t> mask = RegionMask(*reference.height_map, FindIn(reference), {});
  const Pose T_motion = test::BodyMotionAbout({0.6, 0.45, 0.1}, {0.1, -0.05, 0}, 20);
  for (const double radius : {0.0, 0.02, 0.05}) {
    SyntheticOptions moved = options;
    moved.seed = 2;
    moved.T_reference_body = T_motion * options.T_reference_body;
    const Eigen::Vector3d hole(0.55, 0.42, 0);  // on the body, in the reference
    moved.hidden = [&](const Eigen::Vector3d& p) {
      return (T_motion.inverse() * p - hole).head<2>().norm() < radius;
    };
    const RegionCoverage coverage =
        CoverageOf(*reference.height_map, mask, MakeSyntheticScene(moved).cloud, 0.003, T_motion);
    const double hole_fraction =
        3.1416 * radius * radius / MaskArea_m2(*reference.height_map, mask);
    // Cells of 6 mm count as measured when partly so: the hole shrinks by half a cell all round, 30
    // % of the smaller one's area.
    EXPECT_NEAR(1.0 - coverage.coverage, hole_fraction, 0.4 * hole_fraction + 0.001);
    EXPECT_NEAR(coverage.largest_hole_m, 2 * radius, 0.009);
    if (radius == 0) continue;
    EXPECT_LT((coverage.hole_centre_m - hole.head<2>()).norm(), 0.01);
  }
}

}  // namespace
}  // namespace plumb
