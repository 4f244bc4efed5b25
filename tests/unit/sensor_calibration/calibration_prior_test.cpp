// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/calibration_prior.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace plumb {
namespace {

double Sigma(const CalibrationPrior& prior, int term) {
  return (*SigmasOf(prior.information))[term];
}

CalibrationPrior PriorOf(DepthSensor sensor) { return PriorOfAnyUnit(0.04, {.sensor = sensor}); }

// The correction of a depth camera whose disparity is off by a constant: z' = z + c z^2.
CalibrationVector Disparity(double per_m) {
  CalibrationVector x = CalibrationVector::Zero();
  x[kDepthAt + kDepthScale] = x[kDepthAt + kDepthGrowth] = per_m;
  return x;
}

TEST(CalibrationPrior, StructuredLightIsWhatItWas) {
  const CalibrationPrior prior = PriorOf(DepthSensor::kStructuredLight);
  EXPECT_EQ(prior.information, PriorOfAnyUnit(0.04).information);
  EXPECT_TRUE(prior.information.isDiagonal(0.0));
  EXPECT_EQ(prior.num_terms, kCalibrationSize);
  // Whatever is known of lens and stamps: its units are measured.
  EXPECT_EQ(PriorOfAnyUnit(0.04, {.lens_stated_straight = true, .one_stamp = true}).information,
            prior.information);
}

TEST(CalibrationPrior, ADisparityThatIsOffChangesDepthByItsSquare) {
  CalibrationModel model;
  MoveCalibration(Disparity(0.01), model);
  for (const double z_m : {0.4, 1.0, 1.7})
    EXPECT_NEAR(model.CorrectedDepth(z_m, {0.3, -0.2}), z_m + 0.01 * z_m * z_m, 1e-9);
}

TEST(CalibrationPrior, ActiveStereoExpectsIt) {
  const CalibrationPrior stereo = PriorOf(DepthSensor::kActiveStereo);
  const CalibrationPrior light = PriorOf(DepthSensor::kStructuredLight);
  // 0.3 px of a D435.
  const CalibrationVector offset = Disparity(0.3 / 19.6);
  EXPECT_GT(light.Cost(offset), 20.0);
  EXPECT_LT(stereo.Cost(offset), 0.6);
  // The scale alone, or the growth alone, is as unlikely as before.
  CalibrationVector growth = CalibrationVector::Zero();
  growth[kDepthAt + kDepthGrowth] = 0.0153;
  EXPECT_GT(stereo.Cost(growth), 1.0);
}

TEST(CalibrationPrior, ATiltedDisparityIsATiltThatGrows) {
  CalibrationVector tilt = CalibrationVector::Zero();
  tilt[kDepthAt + kDepthSlopeX] = tilt[kDepthAt + kDepthGrowth + 3] = 0.005;
  CalibrationModel model;
  MoveCalibration(tilt, model);
  EXPECT_NEAR(model.CorrectedDepth(1.5, {0.4, 0.1}), 1.5 + 0.005 * 0.4 * 1.5 * 1.5, 1e-9);
  EXPECT_LT(PriorOf(DepthSensor::kActiveStereo).Cost(tilt), 0.6);
  CalibrationVector down = CalibrationVector::Zero();
  down[kDepthAt + kDepthSlopeY] = 0.005;
  down[kDepthAt + kDepthGrowth + 1] = 0.75 * 0.005;
  model = {};
  MoveCalibration(down, model);
  EXPECT_NEAR(model.CorrectedDepth(1.5, {0.1, 0.4}), 1.5 + 0.005 * 0.4 * 1.5 * 1.5, 1e-9);
  EXPECT_LT(PriorOf(DepthSensor::kActiveStereo).Cost(down), 0.6);
}

TEST(CalibrationPrior, AClassHasNoTermsThatItsSensorsDoNotHave) {
  constexpr int kReadout = kDepthAt + kDepthReadout;
  for (const DepthSensor sensor :
       {DepthSensor::kActiveStereo, DepthSensor::kTimeOfFlight, DepthSensor::kLidar})
    EXPECT_LT(Sigma(PriorOf(sensor), kReadout), 1e-4) << Name(sensor);
  EXPECT_NEAR(Sigma(PriorOf(DepthSensor::kTimeOfFlight), kDepthAt + kDepthOffset), 0.010, 1e-9);
  EXPECT_NEAR(Sigma(PriorOf(DepthSensor::kTimeOfFlight), kDepthAt + kDepthScale), 0.003, 1e-9);
  EXPECT_LT(Sigma(PriorOf(DepthSensor::kActiveStereo), kDepthAt + kDepthOffset), 1e-5);
  EXPECT_LT(Sigma(PriorOf(DepthSensor::kLidar), kDepthAt + kDepthField), 1e-5);
  EXPECT_EQ(PriorOf(DepthSensor::kActiveStereo).num_terms, kCalibrationSize - 2);
  EXPECT_EQ(PriorOf(DepthSensor::kTimeOfFlight).num_terms, kCalibrationSize - 1);
  EXPECT_EQ(PriorOf(DepthSensor::kLidar).num_terms,
            kCalibrationSize - 4 - kNumFieldTerms - kNumGrowthTerms);
}

TEST(CalibrationPrior, ALensThatWasNotMeasuredAndStampsThatWereMadeUpAreWide) {
  const CalibrationPrior known = PriorOf(DepthSensor::kActiveStereo);
  EXPECT_NEAR(Sigma(known, kLensAt + 4), 0.01, 1e-9);
  EXPECT_NEAR(Sigma(known, kDepthAt + kDepthDelay), 0.004, 1e-9);
  const CalibrationPrior unknown = PriorOfAnyUnit(
      0.04,
      {.sensor = DepthSensor::kActiveStereo, .lens_stated_straight = true, .one_stamp = true});
  EXPECT_NEAR(Sigma(unknown, kLensAt + 4), 0.1, 1e-9);
  EXPECT_NEAR(Sigma(unknown, kLensAt + 5), 0.2, 1e-9);
  EXPECT_NEAR(Sigma(unknown, kDepthAt + kDepthDelay), 0.016, 1e-9);
  const CalibrationPrior phone = PriorOfAnyUnit(
      0.04, {.sensor = DepthSensor::kLidar, .lens_stated_straight = true, .one_stamp = true});
  EXPECT_EQ(phone.information, PriorOf(DepthSensor::kLidar).information);
}

}  // namespace
}  // namespace plumb
