// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/shared_sensor.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"
#include "algo/sensor_calibration/profile_gate.hpp"

namespace plumb {
namespace {

constexpr int kTerm = kDepthAt + kDepthShiftX;
const Eigen::Vector3d kBodyCentroid(0.5, 0.3, 0.1);

// A body of patches between five markers on the floor. A pixel of depth shift moves the body by
// 1.7 mm along y; the markers stay.
Scene SceneWith(double shift_px, double sigma_px) {
  Scene scene;
  SensorSensitivity sensitivity;
  sensitivity.stated = {640, 480, 525, 525, 319.5, 239.5, {}};
  sensitivity.stated_for_this_unit = true;
  sensitivity.estimate = Eigen::VectorXd::Zero(kCalibrationSize);
  sensitivity.estimate[kTerm] = shift_px;
  sensitivity.covariance = Eigen::MatrixXd::Zero(kCalibrationSize, kCalibrationSize);
  // The covariance that residuals promise; sweeps scatter by three times that.
  sensitivity.covariance(kTerm, kTerm) = sigma_px * sigma_px / 9.0;
  SensorSensitivity::Derivative still = SensorSensitivity::Derivative::Zero(3, kCalibrationSize);
  SensorSensitivity::Derivative moves = still;
  moves(1, kTerm) = 0.0017F;
  for (int i = 0; i < 12; ++i)
    sensitivity.surface.push_back({Eigen::Vector3f(0.35F + 0.1F * static_cast<float>(i % 4),
                                                   0.2F + 0.1F * static_cast<float>(i / 4), 0.1F),
                                   100.0F, moves});
  int id = 0;
  for (const Eigen::Vector2d& at :
       {Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 0), Eigen::Vector2d(1, 0.6),
        Eigen::Vector2d(0, 0.6), Eigen::Vector2d(0.5, 0)}) {
    SceneMarker& marker = scene.markers[id];
    for (Eigen::Vector3d& corner : marker.corners) corner = {at.x(), at.y(), 0};
    marker.sigma_m = 0.001;
    sensitivity.markers[id++] = still;
  }
  scene.sensitivity = sensitivity;
  return scene;
}

Alignment AllMarkers() {
  Alignment alignment;
  alignment.markers_used = {0, 1, 2, 3, 4};
  return alignment;
}

std::optional<SharedSensor> Join(const Scene& reference, const Scene& current,
                                 const Pose& T_motion = Pose::Identity(),
                                 const Alignment& alignment = AllMarkers()) {
  return JoinSensors({.reference = reference,
                      .current = current,
                      .alignment = alignment,
                      .T_motion = T_motion,
                      .centroid_m = kBodyCentroid,
                      .in_region = [](const Eigen::Vector3d& p) { return p.z() > 0.05; }});
}

double DriftPx() { return DriftBetweenSweeps()[kTerm]; }

TEST(SharedSensorTest, TheDifferenceOfTheEstimatesMovesTheMotionBack) {
  // The current scan took the shift for 0.4 px more, so its body lies 0.68 mm too far along y.
  const auto joined = Join(SceneWith(1.0, 0.5), SceneWith(1.4, 0.5));
  ASSERT_TRUE(joined);
  EXPECT_TRUE(joined->one_unit);
  const double known = 2 * 0.25 / (2 * 0.25 + DriftPx() * DriftPx());
  EXPECT_NEAR(joined->correction[4], -0.4 * 0.0017 * known, 1e-6);
  EXPECT_NEAR(joined->correction.head<3>().norm(), 0.0, 1e-9);
  EXPECT_NEAR(joined->correction[3], 0.0, 1e-9);
}

TEST(SharedSensorTest, ABetterKnownEstimateMovesLess) {
  const auto joined = Join(SceneWith(1.0, 0.1), SceneWith(1.4, 0.5));
  ASSERT_TRUE(joined && joined->one_unit);
  const double total = 0.01 + 0.25 + DriftPx() * DriftPx();
  EXPECT_NEAR(joined->correction[4], -0.4 * 0.0017 * (0.01 + 0.25) / total, 1e-6);
}

TEST(SharedSensorTest, WhatBothScansShareIsNotUncertain) {
  const auto joined = Join(SceneWith(1.0, 0.5), SceneWith(1.0, 0.5));
  ASSERT_TRUE(joined && joined->one_unit);
  // Only the drift between the sweeps is left of the body that did not move.
  EXPECT_NEAR(std::sqrt(joined->covariance(4, 4)), 0.0017 * DriftPx(), 0.0017 * 0.02 * DriftPx());
  EXPECT_NEAR(joined->covariance(3, 3), 0.0, 1e-12);
}

TEST(SharedSensorTest, ATurnedBodyCarriesTheErrorOfItsReferenceWithIt) {
  // Turned by 90 degrees about the vertical, the reference's error along y becomes one along -x.
  const Eigen::Vector3d c = kBodyCentroid;
  const Pose turned(Eigen::Translation3d(c) *
                    Eigen::AngleAxisd(90 * kDegree, Eigen::Vector3d::UnitZ()) *
                    Eigen::Translation3d(-c));
  const auto joined = Join(SceneWith(1.0, 0.5), SceneWith(1.4, 0.5), turned);
  ASSERT_TRUE(joined && joined->one_unit);
  const double half = 0.2 * 0.0017 * 2 * 0.25 / (2 * 0.25 + DriftPx() * DriftPx());
  EXPECT_NEAR(joined->correction[3], half, 1e-6);
  EXPECT_NEAR(joined->correction[4], -half, 1e-6);
}

TEST(SharedSensorTest, OtherStatedCalibrationsAreOtherUnits) {
  const Scene reference = SceneWith(1.0, 0.5);
  Scene other = SceneWith(1.4, 0.5);
  other.sensitivity->stated.fx += 0.01;
  const auto apart = Join(reference, other);
  ASSERT_TRUE(apart);
  EXPECT_FALSE(apart->one_unit);
  EXPECT_EQ(apart->correction, Vector6d::Zero());
  // Both estimates count with their whole uncertainty.
  EXPECT_NEAR(std::sqrt(apart->covariance(4, 4)), 0.0017 * 0.5 * std::sqrt(2.0), 1e-7);
}

TEST(SharedSensorTest, NominalIntrinsicsBelongToNoUnit) {
  Scene nominal = SceneWith(1.4, 0.5);
  nominal.sensitivity->stated_for_this_unit = false;
  EXPECT_FALSE(Join(SceneWith(1.0, 0.5), nominal)->one_unit);
  EXPECT_FALSE(Join(nominal, SceneWith(1.0, 0.5))->one_unit);
}

TEST(SharedSensorTest, TheSerialTellsUnitsApart) {
  const auto unit = [](const std::string& serial, bool calibrated) {
    Scene scene = SceneWith(1.0, 0.5);
    scene.sensitivity->serial = serial;
    scene.sensitivity->stated_for_this_unit = calibrated;
    return scene;
  };
  EXPECT_TRUE(Join(unit("A", false), unit("A", false))->one_unit) << "nominal intrinsics";
  EXPECT_FALSE(Join(unit("A", false), unit("B", false))->one_unit);
  EXPECT_FALSE(Join(unit("A", true), unit("B", true))->one_unit) << "a copied calibration file";
  EXPECT_FALSE(Join(unit("A", false), unit("", false))->one_unit);
  EXPECT_TRUE(Join(unit("A", true), unit("", true))->one_unit) << "a recording has no serial";
}

TEST(SharedSensorTest, EstimatesThatContradictEachOtherAreOfTwoUnits) {
  const double sigma = std::sqrt(2 * 0.25 + DriftPx() * DriftPx());
  const double limit = std::sqrt(ChiSquareLimit(1)) * sigma;
  EXPECT_TRUE(Join(SceneWith(0.0, 0.5), SceneWith(0.99 * limit, 0.5))->one_unit);
  EXPECT_FALSE(Join(SceneWith(0.0, 0.5), SceneWith(1.01 * limit, 0.5))->one_unit);
  // One of the two is off by that much, and there is no telling which.
  const Matrix6d twice = Join(SceneWith(0.0, 0.5), SceneWith(2 * limit, 0.5))->covariance,
                 thrice = Join(SceneWith(0.0, 0.5), SceneWith(3 * limit, 0.5))->covariance;
  EXPECT_NEAR(thrice(4, 4) / twice(4, 4), 9.0 / 4, 1e-6);
  EXPECT_NEAR(std::sqrt(twice(4, 4)),
              0.0017 * 0.5 * std::sqrt(2.0) * 2 * std::sqrt(ChiSquareLimit(1)), 1e-7);
}

TEST(SharedSensorTest, NeedsASensitivityMarkersAndTheRegion) {
  const Scene scene = SceneWith(1.0, 0.5);
  Scene without = scene;
  without.sensitivity.reset();
  EXPECT_FALSE(Join(scene, without));
  EXPECT_FALSE(Join(without, scene));
  Alignment two = AllMarkers();
  two.markers_used = {0, 1};
  EXPECT_FALSE(Join(scene, scene, Pose::Identity(), two));
  Scene little = scene;
  little.sensitivity->surface.resize(3);
  EXPECT_FALSE(Join(little, scene));
}

}  // namespace
}  // namespace plumb
