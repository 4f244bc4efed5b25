// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/unit_lens.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "drivers/simulator/sensor/ray_caster.hpp"

namespace plumb::simulated {
namespace {

SensorUnit UnitWith(LensKind kind, NoiseLevel level = NoiseLevel::kNominal) {
  SensorUnit unit = MakeSensorUnit(level, 91, 640, 480);
  GiveLens(unit, kind);
  return unit;
}

TEST(UnitLensTest, AFisheyeIsKannalaAndBrandtsItself) {
  const SensorUnit unit = UnitWith(LensKind::kFisheye);
  const Intrinsics& camera = unit.color_true;
  ASSERT_TRUE(unit.color_lens_rest.equidistant);
  const auto& k = *unit.color_lens_rest.equidistant;
  double farthest = 0.0;
  for (const double x : {0.0, 160.0, 319.0, 500.0, 639.0})
    for (const double y : {0.0, 100.0, 239.0, 479.0}) {
      LensRest main = unit.color_lens_rest;
      main.prism = {};
      main.k4 = 0.0;
      const Eigen::Vector2d ideal = Undistort(camera, main, {x, y});
      const double theta = std::atan(ideal.norm()), t2 = theta * theta;
      const double radius = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
      const Eigen::Vector2d distorted = radius / ideal.norm() * ideal;
      EXPECT_NEAR(camera.cx + camera.fx * distorted.x(), x, 1e-6);
      EXPECT_NEAR(camera.cy + camera.fy * distorted.y(), y, 1e-6);
      // The method's camera is another one, but near.
      const Eigen::Vector2d near = Project(camera, {ideal.x(), ideal.y(), 1.0});
      EXPECT_LT((near - Eigen::Vector2d(x, y)).norm(), 0.05);
      const Eigen::Vector2d pinhole(camera.cx + camera.fx * ideal.x(),
                                    camera.cy + camera.fy * ideal.y());
      farthest = std::max(farthest, (pinhole - Eigen::Vector2d(x, y)).norm());
    }
  EXPECT_GT(farthest, 30.0) << "it bends rays by far more than a plain lens's error";
}

TEST(UnitLensTest, ARationalLensHasEightCoefficientsThatCanBeUndone) {
  const SensorUnit unit = UnitWith(LensKind::kRational);
  const Intrinsics& camera = unit.color_true;
  EXPECT_EQ(LensCoefficients(camera).size(), 8U);
  for (const double x : {0.0, 160.0, 639.0})
    for (const double y : {0.0, 300.0, 479.0}) {
      const Eigen::Vector2d ideal = plumb::Undistort(camera, {x, y});
      const Eigen::Vector2d back = Project(camera, {ideal.x(), ideal.y(), 1.0});
      EXPECT_LT((back - Eigen::Vector2d(x, y)).norm(), 1e-3);
      const Eigen::Vector2d pinhole(camera.cx + camera.fx * ideal.x(),
                                    camera.cy + camera.fy * ideal.y());
      EXPECT_LT((pinhole - Eigen::Vector2d(x, y)).norm(), 40.0) << "as makers' lenses do";
      const Eigen::Vector2d written = Project(unit.color_written, {ideal.x(), ideal.y(), 1.0});
      EXPECT_LT((written - Eigen::Vector2d(x, y)).norm(), 8.0) << "errors of a calibration";
    }
  EXPECT_NE(camera.distortion, unit.color_written.distortion);
}

TEST(UnitLensTest, WithoutErrorsOfCalibrationTheLensIsStatedAsItIs) {
  for (const LensKind kind : {LensKind::kRational, LensKind::kFisheye}) {
    const SensorUnit unit = UnitWith(kind, NoiseLevel::kIdeal);
    EXPECT_EQ(unit.color_true, unit.color_written);
  }
}

TEST(UnitLensTest, APlainUnitIsLeftAsItIs) {
  const SensorUnit usual = MakeSensorUnit(NoiseLevel::kNominal, 91, 640, 480);
  const SensorUnit unit = UnitWith(LensKind::kPlain);
  EXPECT_EQ(unit.color_true, usual.color_true);
  EXPECT_EQ(unit.color_lens_rest, usual.color_lens_rest);
}

TEST(UnitLensTest, WideImagesShowMoreToTheSides) {
  const SensorUnit usual = MakeSensorUnit(NoiseLevel::kNominal, 91, 640, 480);
  const SensorUnit wide = MakeSensorUnit(NoiseLevel::kNominal, 91, 848, 480);
  EXPECT_EQ(wide.color_true.width, 848);
  EXPECT_EQ(wide.color_true.fx, usual.color_true.fx);
  EXPECT_EQ(wide.color_true.cx, usual.color_true.cx + 104.0);
  EXPECT_EQ(wide.depth_true.cy, usual.depth_true.cy);
}

}  // namespace
}  // namespace plumb::simulated
