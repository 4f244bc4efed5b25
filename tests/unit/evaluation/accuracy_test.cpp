// SPDX-License-Identifier: Apache-2.0
#include "daemon/evaluation/accuracy.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

Pose PoseOf(double rx_deg, double ry_deg, double rz_deg, double x, double y, double z) {
  Vector6d twist;
  twist << rx_deg * kDegree, ry_deg * kDegree, rz_deg * kDegree, x, y, z;
  return PoseFromTwist(twist);
}

/// A body that is one flat roof: z = height over a square of the given half side, at a placement.
SceneTruth RoofAt(const Pose& T_world_body, double half_side, double height) {
  SceneTruth truth;
  truth.T_world_body = T_world_body;
  for (const auto& [x, y] : {std::pair(-half_side, -half_side),
                             {half_side, -half_side},
                             {half_side, half_side},
                             {-half_side, half_side}}) {
    truth.body.vertices_world.push_back(T_world_body * Eigen::Vector3d(x, y, height));
    truth.body.frames_seen.push_back(10);
  }
  truth.body.triangles = {{0, 1, 2}, {0, 2, 3}};
  truth.centroid_body = Eigen::Vector3d(0, 0, height);
  return truth;
}

TEST(SummariseTest, TakesQuantilesBetweenRanks) {
  const ErrorSummary summary = Summarise({4, 1, 3, 2, 5});
  EXPECT_DOUBLE_EQ(summary.mean, 3);
  EXPECT_DOUBLE_EQ(summary.median, 3);
  EXPECT_DOUBLE_EQ(summary.p95, 4.8);
  EXPECT_DOUBLE_EQ(summary.max, 5);
  EXPECT_DOUBLE_EQ(summary.rms, std::sqrt(11.0));
}

TEST(SummariseTest, OfNothingIsZero) { EXPECT_EQ(Summarise({}).count, 0U); }

// The same motion written down by hand in the marker's frame: the body goes 0.1 m along world x,
// and the marker is turned by 90 degrees about z, so that this is -y of the marker.
TEST(MotionErrorTest, TrueMotionIsToldInTheMarkersFrame) {
  SceneTruth reference = RoofAt(Pose::Identity(), 0.2, 0.1),
             current = RoofAt(PoseOf(0, 0, 0, 0.1, 0, 0), 0.2, 0.1);
  reference.T_world_reference_marker = PoseOf(0, 0, 90, 0.5, 0.3, 0);
  const Pose motion = TrueMotion(reference, current);
  EXPECT_NEAR(motion.translation().x(), 0.0, 1e-12);
  EXPECT_NEAR(motion.translation().y(), -0.1, 1e-12);
  EXPECT_NEAR(RotationAngle(motion), 0.0, 1e-12);
}

// A pure rotation error about the centroid moves the centroid by nothing; about the marker's origin
// it would.
TEST(MotionErrorTest, IsTakenAtTheReferenceBodysCentroid) {
  SceneTruth reference = RoofAt(PoseOf(0, 0, 0, 0.6, 0.4, 0), 0.2, 0.1);
  const SceneTruth current = reference;
  const Eigen::Vector3d centroid(0.6, 0.4, 0.1);
  Pose turned = PoseOf(0, 0, 2, 0, 0, 0);
  turned.translation() = centroid - turned.linear() * centroid;
  const MotionError about_centroid = ErrorOfMotion(turned, reference, current);
  EXPECT_NEAR(about_centroid.rotation_deg, 2.0, 1e-9);
  EXPECT_NEAR(about_centroid.translation_mm, 0.0, 1e-9);
  const MotionError about_origin = ErrorOfMotion(PoseOf(0, 0, 2, 0, 0, 0), reference, current);
  EXPECT_NEAR(about_origin.translation_mm, 2 * std::sin(1 * kDegree) * std::hypot(600.0, 400.0),
              1e-9);
}

TEST(TrajectoryErrorTest, IgnoresTheWorldButNotTheScale) {
  SceneTruth truth;
  std::vector<StampedPose> moved, grown;
  const Pose T_scene_world = PoseOf(10, -20, 30, 1, 2, 3);
  for (int i = 0; i < 50; ++i) {
    const double t = 0.02 * i;
    const Pose T = PoseOf(5 * t, 0, 20 * t, t, std::sin(3 * t), 0.5);
    truth.trajectory.push_back({.time_s = t, .T_world_camera = T});
    moved.push_back({.time_s = t, .T_world_camera = T_scene_world * T});
    grown.push_back(moved.back());
    grown.back().T_world_camera.translation() *= 1.01;
  }
  const auto exact = ErrorOfTrajectory(moved, truth);
  ASSERT_TRUE(exact);
  EXPECT_EQ(exact->count, 50U);
  EXPECT_NEAR(exact->rmse_mm, 0.0, 1e-9);
  EXPECT_NEAR(exact->rotation_rmse_deg, 0.0, 1e-6);
  EXPECT_NEAR((exact->T_world_scene * T_scene_world).translation().norm(), 0.0, 1e-9);
  // 1 % of a path of about 1 m with an RMS radius of some 0.4 m.
  const auto scaled = ErrorOfTrajectory(grown, truth);
  ASSERT_TRUE(scaled);
  EXPECT_GT(scaled->rmse_mm, 2.0);
}

TEST(TrajectoryErrorTest, NeedsPosesWithATruth) {
  SceneTruth truth;
  truth.trajectory = {{.time_s = 0}, {.time_s = 0.05}};
  const std::vector<StampedPose> late(5, {.time_s = 7.0});
  EXPECT_FALSE(ErrorOfTrajectory(late, truth));
}

TEST(TruePoseTest, InterpolatesWithinTheRecordedTimeOnly) {
  std::vector<StampedPose> trajectory = {
      {.time_s = 1.0},
      {.time_s = 1.05, .T_world_camera = PoseOf(0, 0, 10, 0.2, 0, 0)},
      {.time_s = 2.0}};
  const auto middle = TruePoseAt(trajectory, 1.025);
  ASSERT_TRUE(middle);
  EXPECT_NEAR(middle->translation().x(), 0.1, 1e-12);
  EXPECT_NEAR(RotationAngle(*middle) / kDegree, 5.0, 1e-9);
  EXPECT_FALSE(TruePoseAt(trajectory, 0.99));
  EXPECT_FALSE(TruePoseAt(trajectory, 1.5)) << "neighbours 0.95 s apart";
  EXPECT_TRUE(TruePoseAt(trajectory, 2.0));
  EXPECT_FALSE(TruePoseAt(trajectory, 2.01));
}

const GridShape kGrid{.x_min = -0.15, .y_min = -0.15, .step = 0.01, .width = 30, .height = 30};

TEST(TrueHeightsTest, CoversTheRoofAndNothingElse) {
  const HeightMap heights =
      TrueHeights(RoofAt(Pose::Identity(), 0.1, 0.05), kGrid, Pose::Identity(), 1);
  int count = 0;
  for (const float z : heights.z) {
    if (!std::isfinite(z)) continue;
    EXPECT_FLOAT_EQ(z, 0.05F);
    ++count;
  }
  EXPECT_EQ(count, 400);  // 0.2 m / 0.01 m squared
}

TEST(TrueHeightsTest, AHiddenRoofAboveHidesTheFloorBelow) {
  SceneTruth truth = RoofAt(Pose::Identity(), 0.1, 0.05);
  const SceneTruth low = RoofAt(Pose::Identity(), 0.1, 0.01);
  truth.body.frames_seen.assign(4, 0);
  truth.body.vertices_world.insert(truth.body.vertices_world.end(), low.body.vertices_world.begin(),
                                   low.body.vertices_world.end());
  truth.body.frames_seen.insert(truth.body.frames_seen.end(), 4, 10);
  truth.body.triangles.push_back({4, 5, 6});
  truth.body.triangles.push_back({4, 6, 7});
  for (const float z : TrueHeights(truth, kGrid, Pose::Identity(), 1).z)
    EXPECT_FALSE(std::isfinite(z));
}

TEST(HeightErrorTest, CountsBiasAndCompleteness) {
  const HeightMap truth =
      TrueHeights(RoofAt(Pose::Identity(), 0.1, 0.05), kGrid, Pose::Identity(), 1);
  HeightMap estimate = truth;
  int seen = 0;
  for (float& z : estimate.z) {
    if (!std::isfinite(z)) continue;
    z = ++seen % 4 == 0 ? std::numeric_limits<float>::quiet_NaN() : z + 0.002F;
  }
  const HeightError error = ErrorOfHeights(estimate, truth);
  EXPECT_EQ(error.count, 300U);
  EXPECT_DOUBLE_EQ(error.completeness, 0.75);
  EXPECT_NEAR(error.bias_mm, 2.0, 1e-4);
  EXPECT_NEAR(error.median_abs_mm, 2.0, 1e-4);
  EXPECT_NEAR(error.rmse_mm, 2.0, 1e-4);
}

TEST(DeformationErrorTest, MeasuresAcrossTheSurfaceWithAndWithoutTheField) {
  // A plane that rises by one along x: across it a height difference counts for 1/sqrt(2).
  HeightMap truth(kGrid);
  for (int row = 0; row < kGrid.height; ++row) {
    for (int column = 0; column < kGrid.width; ++column)
      truth.z[static_cast<std::size_t>(row * kGrid.width + column)] =
          static_cast<float>(kGrid.x_centre(column));
  }
  const Pose T_motion(Eigen::Translation3d(0, 0, 0.1));
  Deformation field;
  const Eigen::Vector3f above = Eigen::Vector3f::UnitZ();
  for (const float x : {-0.03F, 0.002F, 0.041F}) {
    field.points.emplace_back(x, 0.01F, x - 0.1F);
    field.shifts_m.emplace_back(-0.003F * above);  // where it should stay
    field.observed.push_back(1);
  }
  field.points.emplace_back(0.0F, 0.0F, 0.5F);  // far off, but never seen
  field.shifts_m.emplace_back(Eigen::Vector3f::Zero());
  field.observed.push_back(0);
  const DeformationError error = ErrorOfDeformation(field, T_motion, truth);
  EXPECT_EQ(error.rigid_mm.count, 3U);
  EXPECT_NEAR(error.rigid_mm.max, 0.0, 1e-3);
  EXPECT_NEAR(error.deformed_mm.median, 3.0 / std::sqrt(2.0), 1e-3);
  EXPECT_EQ(error.deformed_mm.count, 3U);
}

/// A wavy surface whose shape fixes all six degrees of freedom, moved by T before it is sampled.
HeightMap Waves(const Pose& T_frame_body, double scale) {
  HeightMap map({.x_min = 0, .y_min = 0, .step = 0.002, .width = 200, .height = 150});
  const auto height = [](double x, double y) {
    return 0.05 + 0.02 * std::sin(12 * x) + 0.015 * std::cos(17 * y + 5 * x);
  };
  const Pose T_body_frame = T_frame_body.inverse();
  for (int row = 0; row < map.grid.height; ++row) {
    for (int column = 0; column < map.grid.width; ++column) {
      const double x = map.grid.x_centre(column), y = map.grid.y_centre(row);
      double z = 0.05;
      for (int i = 0; i < 20; ++i) {  // fixed point: the height over (x, y) of the moved surface
        const Eigen::Vector3d p = (T_body_frame * Eigen::Vector3d(x, y, z)) / scale;
        z += scale * (height(p.x(), p.y()) - p.z());
      }
      map.z[static_cast<std::size_t>(row) * 200 + static_cast<std::size_t>(column)] =
          static_cast<float>(z);
    }
  }
  return map;
}

// The fit is linear, so it recovers small motions up to second order: 1.5 mm and 0.3 deg leave
// about 0.02 mm.
TEST(ShapeErrorTest, TellsAMisplacedFrameFromAWrongShape) {
  Pose T = PoseOf(0.2, -0.1, 0.3, 0, 0, 0);
  const Eigen::Vector3d centre(0.2, 0.15, 0.05), shift(0.0012, -0.0007, 0.0009);
  T.translation() = centre + shift - T.linear() * centre;
  const auto error = ErrorOfShape(Waves(T, 1.0), Waves(Pose::Identity(), 1.0));
  ASSERT_TRUE(error);
  EXPECT_NEAR((error->shift_mm - shift / kMillimetre).norm(), 0.0, 0.08);  // measured 0.02
  EXPECT_NEAR((error->rotation_deg - Eigen::Vector3d(0.2, -0.1, 0.3)).norm(), 0.0,
              0.03);  // measured 0.01
  EXPECT_LT(error->left.p95_mm, 0.1);
}

TEST(ShapeErrorTest, FindsScale) {
  const auto error = ErrorOfShape(Waves(Pose::Identity(), 1.005), Waves(Pose::Identity(), 1.0));
  ASSERT_TRUE(error);
  EXPECT_NEAR(error->scale_permille, 5.0, 0.4);
}

// Markers with one corner that is off, by just less and just more than the interval.
TEST(MarkerCoverageTest, CountsCoordinatesWithinTheirIntervals) {
  SceneTruth truth;
  MarkerMap estimated;
  const Pose T_scene_world = PoseOf(10, 20, 30, 1, 2, 3);
  for (int id = 0; id < 40; ++id) {
    MarkerCorners corners = CornersInMarkerFrame(0.1);
    for (Eigen::Vector3d& p : corners) p += Eigen::Vector3d(0.2 * (id % 8), 0.2 * (id / 8), 0);
    truth.markers[id] = corners;
    for (Eigen::Vector3d& p : corners) p = T_scene_world * p;
    estimated[id] = {corners, 3, 0.001};
  }
  const IntervalCount exact = CoverageOfMarkers(estimated, truth);
  EXPECT_EQ(exact.count, 480U);
  EXPECT_EQ(exact.inside, 480U);
  // One corner of 160 hardly turns or shifts the fit.
  estimated[11].corners[2].y() += 0.0019;
  EXPECT_EQ(CoverageOfMarkers(estimated, truth).inside, 480U);
  estimated[11].corners[2].y() += 0.0002;
  EXPECT_EQ(CoverageOfMarkers(estimated, truth).inside, 479U);
  estimated[40] = estimated[3];  // Not in the truth.
  EXPECT_EQ(CoverageOfMarkers(estimated, truth).count, 480U);
  EXPECT_EQ(CoverageOfMarkers({}, truth).count, 0U);
}

}  // namespace
}  // namespace plumb
