// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/other_classes.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb::simulated {
namespace {

SensorUnit UnitOf(DepthSensor sensor,
                  const FaultSet& faults = FaultSet().With(Fault::kDepthScale)) {
  return MakeSensorUnit(NoiseLevel::kIdeal, 7, 640, 480, faults, sensor);
}

// Of a wall at this distance, in the middle of the image.
double ErrorAt(const SensorUnit& unit, double z_m, double time_s = 0.0, int x = 320) {
  const cv::Mat wall(480, 640, CV_32FC1, cv::Scalar(z_m));
  return ClassDepth(unit, wall, {}, time_s, 1).At(x, 240, 1.0F) - z_m;
}

TEST(OtherClassesTest, WithoutAClassNothingChanges) {
  const FaultSet faults = FaultsOf(NoiseLevel::kNominal);
  const SensorUnit usual = MakeSensorUnit(NoiseLevel::kNominal, 7, 640, 480, faults);
  const SensorUnit other =
      MakeSensorUnit(NoiseLevel::kNominal, 7, 640, 480, faults, DepthSensor::kActiveStereo);
  EXPECT_EQ(usual.depth_sensor, DepthSensor::kStructuredLight);
  EXPECT_GT(usual.axial_noise, 0.0);
  EXPECT_EQ(other.axial_noise, 0.0);
  EXPECT_EQ(other.depth_readout_s, 0.0) << "a global shutter";
  EXPECT_EQ(other.readout_s, usual.readout_s);
  EXPECT_FALSE(HasLens(other.color_written));
  EXPECT_GT(other.color_true.distortion[0], 0.02);
}

TEST(OtherClassesTest, ADisparityThatIsOffErrsWithTheSquareOfTheDepth) {
  const SensorUnit unit = UnitOf(DepthSensor::kActiveStereo);
  const double base = unit.depth_true.fx * unit.class_errors.baseline_m;
  ASSERT_GT(std::abs(unit.class_errors.disparity_px), 0.1);
  for (const double z_m : {0.5, 1.0, 2.0}) {
    const double expected = -unit.class_errors.disparity_px * z_m * z_m / base;
    // The ripple of 0.05 px lies on top.
    EXPECT_NEAR(ErrorAt(unit, z_m), expected, 0.06 * z_m * z_m / base + 0.2 * std::abs(expected));
  }
}

TEST(OtherClassesTest, NearerSurfacesAreFat) {
  const SensorUnit unit = UnitOf(DepthSensor::kActiveStereo, FaultSet().With(Fault::kDepthNoise));
  cv::Mat step(480, 640, CV_32FC1, cv::Scalar(1.2));
  step.colRange(0, 320).setTo(0.8);
  const cv::Mat no_skin;
  const ClassDepth depth(unit, step, no_skin, 0.0, 1);
  EXPECT_NEAR(depth.At(322, 240, 1.0F), 0.8, 0.02);
  EXPECT_NEAR(depth.At(330, 240, 1.0F), 1.2, 0.04);
}

TEST(OtherClassesTest, TimeOfFlightHasAWaveHollowsAndSkin) {
  const SensorUnit unit = UnitOf(DepthSensor::kTimeOfFlight);
  double least = 1.0, most = -1.0;
  for (double z_m = 0.6; z_m < 1.1; z_m += 0.02) {
    least = std::min(least, ErrorAt(unit, z_m));
    most = std::max(most, ErrorAt(unit, z_m));
  }
  EXPECT_NEAR(most - least, 0.006, 0.0005);
  cv::Mat wall(480, 640, CV_32FC1, cv::Scalar(1.0)), skin(480, 640, CV_8UC1, cv::Scalar(0));
  skin.at<std::uint8_t>(240, 320) = 1;
  const ClassDepth depth(unit, wall, skin, 0.0, 1);
  EXPECT_NEAR(depth.At(320, 240, 1.0F) - depth.At(321, 240, 1.0F), 0.010, 0.0031);
  wall.at<float>(100, 100) = 1.04F;
  EXPECT_NEAR(depth.At(100, 100, 1.0F) - ErrorAt(unit, 1.04) - 1.04, 0.012, 1e-4) << "a hollow";
}

TEST(OtherClassesTest, ALidarWandersFromImageToImage) {
  const SensorUnit unit = UnitOf(DepthSensor::kLidar);
  double sum = 0.0, sum2 = 0.0, turn = 0.0;
  constexpr int kImages = 400;
  for (int i = 0; i < kImages; ++i) {
    const double error = ErrorAt(unit, 1.0, i / 5.0);
    sum += error;
    sum2 += error * error;
    turn = std::max(turn, std::abs(ErrorAt(unit, 1.0, i / 5.0, 600) - error));
  }
  const double mean = sum / kImages;
  EXPECT_NEAR(std::sqrt(sum2 / kImages - mean * mean), 0.005, 0.001);
  EXPECT_NEAR(mean, unit.class_errors.offset_m, 0.001);
  EXPECT_GT(turn, 0.5 * std::tan(0.5 * kDegree));
}

}  // namespace
}  // namespace plumb::simulated
