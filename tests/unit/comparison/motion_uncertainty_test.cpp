// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/motion_uncertainty.hpp"

#include <random>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

// Markers that agree to 1 mm a coordinate over 0.7 m, centred beside the body.
Alignment SomeAlignment() {
  Alignment alignment;
  alignment.centre_m = {0.5, 0.4, 0.0};
  alignment.spread_m = 0.7;
  alignment.stretch_sigma = 0.0005;
  alignment.distortion = 1e-6 * Eigen::Matrix3d::Identity();
  alignment.covariance = 1e-8 * Matrix6d::Identity();
  return alignment;
}

constexpr double kMillimetre2 = kMillimetre * kMillimetre;
const Eigen::Vector3d kCentroid(0.6, 0.45, 0.1);

MotionUncertainty Of(const Pose& T_motion, const Alignment& alignment = SomeAlignment(),
                     double scale_doubt = 0.0) {
  static const Matrix6d kSurface = 1e-9 * Matrix6d::Identity();
  return Uncertainty({.alignment = alignment,
                      .surface = kSurface,
                      .T_motion = T_motion,
                      .centroid_m = kCentroid,
                      .sensor = std::nullopt,
                      .scale_doubt = scale_doubt,
                      .breathing_m = 0.005});
}

TEST(MotionUncertaintyTest, TheTotalIsTheSumOfItsNamedParts) {
  const MotionUncertainty uncertainty = Of(Pose(Eigen::Translation3d(0.2, 0.1, 0)));
  Matrix6d sum = Matrix6d::Zero();
  for (const auto& [name, part] : uncertainty.Parts()) {
    EXPECT_GE(part->diagonal().minCoeff(), 0.0) << name;
    EXPECT_GT(part->trace(), 0.0) << name;
    sum += *part;
  }
  EXPECT_TRUE(sum.isApprox(uncertainty.Total()));
}

TEST(MotionUncertaintyTest, TheLargestCauseIsNamedForShiftsAndForRotations) {
  MotionUncertainty uncertainty;
  uncertainty.surface.diagonal() << 0, 0, 4e-6, 0, 0, 0;
  uncertainty.sensor.diagonal() << 0, 0, 3e-6, 0, 0, 1e-6;
  uncertainty.distortion.diagonal() << 0, 0, 0, 0, 9e-7, 0;
  const auto cause = [&](bool of_turns) {
    return LargestCause(uncertainty, SomeAlignment(), of_turns).id();
  };
  EXPECT_EQ(cause(true), "comparison.cause_surface");
  EXPECT_EQ(cause(false), "comparison.cause_sensor");
  uncertainty.distortion(5, 5) = 2e-7;
  EXPECT_EQ(cause(false), "comparison.cause_markers");
}

TEST(MotionUncertaintyTest, BreathingCountsByTheRiseOfTheChest) {
  const Matrix6d breathing = Of(Pose::Identity()).breathing;
  EXPECT_NEAR(std::sqrt(breathing(3, 3)), 0.1 * 0.005, 1e-9);
  EXPECT_NEAR(std::sqrt(breathing(0, 0)), 0.1 * 0.005, 1e-9);
}

TEST(MotionUncertaintyTest, WhatTheMapsDisagreeByAtAPlaceIsNotAveragedAway) {
  Alignment about_body = SomeAlignment();
  about_body.centre_m = kCentroid;
  const MotionUncertainty uncertainty = Of(Pose::Identity(), about_body);
  EXPECT_NEAR(uncertainty.distortion(4, 4), kMillimetre2, 1e-12);
  EXPECT_NEAR(std::sqrt(uncertainty.distortion(1, 1)), 0.001 / 0.7, 1e-9);
  about_body.distortion = Eigen::Vector3d(9e-6, 0, 0).asDiagonal();
  about_body.spread_m = 1e6;
  const MotionUncertainty along_x = Of(Pose::Identity(), about_body);
  EXPECT_NEAR(along_x.distortion(3, 3), 9 * kMillimetre2, 1e-12);
  EXPECT_NEAR(along_x.distortion(4, 4), 0.0, 1e-15);
}

TEST(MotionUncertaintyTest, WhatTheMapsDisagreeByGrowsBesideTheMarkers) {
  Alignment beside = SomeAlignment();
  beside.centre_m = kCentroid - Eigen::Vector3d(0, 0.7, 0);
  // Turned about an axis along x by 1 mm over the spread, a body one spread away along y is lifted
  // by another millimetre.
  const Matrix6d distortion = Of(Pose::Identity(), beside).distortion;
  EXPECT_NEAR(distortion(5, 5), 2 * kMillimetre2, 1e-12);
  EXPECT_NEAR(distortion(4, 4), kMillimetre2, 1e-12) << "not along the way";
  EXPECT_NEAR(std::sqrt(distortion(0, 0)), 0.001 / 0.7, 1e-9);
}

TEST(MotionUncertaintyTest, FrameAndScaleCountOnlyForABodyThatMoved) {
  const MotionUncertainty still = Of(Pose::Identity());
  EXPECT_NEAR(still.frame.norm(), 0.0, 1e-15);
  const MotionUncertainty shifted = Of(Pose(Eigen::Translation3d(0.3, 0, 0)));
  // A frame tilted by 1 mm / sqrt(2) over 0.3 m lifts the end of a way of 0.3 m by 0.7 mm.
  EXPECT_NEAR(std::sqrt(shifted.frame(5, 5)) / kMillimetre, 0.707, 0.01);
  EXPECT_NEAR((shifted.frame.topLeftCorner<3, 3>()).norm(), 0.0, 1e-12) << "a shift turns nothing";
  EXPECT_GT(shifted.scale(3, 3), still.scale(3, 3) + 0.1 * kMillimetre2);
  EXPECT_NEAR(shifted.scale(4, 4), still.scale(4, 4), 1e-12) << "only along the way";
}

TEST(MotionUncertaintyTest, ADoubtedScaleIsWithinTheIntervalAsAWhole) {
  const Pose T(Eigen::Translation3d(0.2, 0, 0));
  const auto half_width_m = [&](double doubt) {
    const double still = Of(Pose::Identity(), SomeAlignment(), doubt).scale(3, 3);
    return 1.96 * std::sqrt(Of(T, SomeAlignment(), doubt).scale(3, 3) - still);
  };
  // The arm from the markers' centre adds a little.
  EXPECT_NEAR(half_width_m(0.0), 0.005 * 0.2, 0.3 * kMillimetre) << "prints err by 0.5 %";
  EXPECT_NEAR(half_width_m(0.03), 0.03 * 0.2, 0.3 * kMillimetre);
}

// The analytic frame term against motions that were turned into other frames, one after the other.
TEST(MotionUncertaintyTest, TheFrameTermIsTheScatterOverFrames) {
  const Pose T_motion = Eigen::Translation3d(0.1, -0.2, 0.02) *
                        Pose(Eigen::AngleAxisd(0.6, Eigen::Vector3d(0.1, 0, 1).normalized()));
  const Matrix6d claimed = Of(T_motion).frame;
  const double sigma_m = std::sqrt(0.5) * kMillimetre;
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  Matrix6d scatter = Matrix6d::Zero();
  constexpr int kTrials = 4000;
  const Eigen::Vector3d moved = T_motion * kCentroid;
  for (int trial = 0; trial < kTrials; ++trial) {
    Vector6d twist;
    for (int i = 0; i < 6; ++i) twist[i] = sigma_m * normal(random);
    twist[0] /= 0.3, twist[1] /= 0.3, twist[2] /= 2.0;
    const Pose F = PoseFromTwist(twist);
    const Pose error = F * T_motion * F.inverse() * T_motion.inverse();
    Vector6d off;
    off << VectorFromRotation(error.linear()), error * moved - moved;
    scatter += off * off.transpose() / kTrials;
  }
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(claimed(i, i) / scatter(i, i), 1.0, 0.1) << i;  // 4000 trials: 2 % of a variance
  }
}

TEST(MotionUncertaintyTest, ACovarianceAboutAnotherPointMovesThatPointAsTheFirstSays) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance(2, 2) = 1e-6;  // a turn about z alone
  const Matrix6d moved = CovarianceAbout(covariance, {0, 0, 0}, {2, 0, 0});
  EXPECT_NEAR(moved(4, 4), 4e-6, 1e-15);
  EXPECT_NEAR(moved(3, 3), 0.0, 1e-15);
  EXPECT_NEAR(moved(2, 4), 2e-6, 1e-15);
}

TEST(MotionUncertaintyTest, TheSensorsCovarianceTakesThePlaceOfTheUsualOne) {
  const Alignment alignment = SomeAlignment();
  const Matrix6d surface = 1e-9 * Matrix6d::Identity();
  const Matrix6d sensor = 3e-7 * Matrix6d::Identity();
  const MotionUncertainty with = Uncertainty({.alignment = alignment,
                                              .surface = surface,
                                              .T_motion = Pose::Identity(),
                                              .centroid_m = kCentroid,
                                              .sensor = sensor});
  EXPECT_EQ(with.sensor, sensor);
  const auto of_classes = [&](std::vector<DepthSensor> classes) {
    return Uncertainty({.alignment = alignment,
                        .surface = surface,
                        .T_motion = Pose::Identity(),
                        .centroid_m = kCentroid,
                        .sensor = sensor,
                        .classes = std::move(classes)})
        .sensor;
  };
  // Two scans by a time-of-flight camera: 0.09 deg each about a level axis.
  const Matrix6d flight = of_classes({DepthSensor::kTimeOfFlight, DepthSensor::kTimeOfFlight});
  EXPECT_NEAR(std::sqrt((flight - sensor)(0, 0)) / kDegree, 0.127, 0.001);
  EXPECT_LT((flight - sensor)(2, 2), (flight - sensor)(1, 1));
  EXPECT_TRUE((flight - sensor).bottomRightCorner(3, 3).isZero(0.0));
  // Two by a phone: 0.4 mm each along both level axes.
  const Matrix6d phone = of_classes({DepthSensor::kLidar, DepthSensor::kLidar}) - sensor;
  EXPECT_NEAR(std::sqrt(phone(3, 3)) / kMillimetre, 0.566, 0.001);
  EXPECT_EQ(phone(4, 4), phone(3, 3));
  EXPECT_EQ(phone(5, 5), 0.0) << "heights are what the calibration and the images' errors state";
  EXPECT_EQ(of_classes({DepthSensor::kActiveStereo, DepthSensor::kActiveStereo}), sensor);
  // By structured light: 0.024 deg each about the vertical, 0.018 deg about a level axis.
  const Matrix6d light = of_classes({DepthSensor::kStructuredLight, DepthSensor::kStructuredLight});
  EXPECT_NEAR(std::sqrt((light - sensor)(2, 2)) / kDegree, 0.034, 0.001);
  EXPECT_NEAR(std::sqrt((light - sensor)(0, 0)) / kDegree, 0.0255, 0.0005);
  // 0.4 mm for each of the two sweeps.
  EXPECT_NEAR(std::sqrt(Of(Pose::Identity()).sensor(3, 3)) / kMillimetre, 0.566, 0.001);
}

}  // namespace
}  // namespace plumb
