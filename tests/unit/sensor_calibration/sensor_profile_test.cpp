// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/sensor_profile.hpp"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "algo/base/errors.hpp"

namespace plumb {
namespace {

constexpr int kProfiledFocal = kLensAt;
constexpr int kProfiledScale = kDepthAt + kDepthScale;

Intrinsics StatedForProfile() {
  Intrinsics k;
  k.width = 640;
  k.height = 480;
  k.fx = k.fy = 525;
  k.cx = 319.5;
  k.cy = 239.5;
  return k;
}

double Sigma(const SensorProfile& profile, int term) {
  return std::sqrt(profile.covariance(term, term));
}

// A sweep that sees two terms, each with this standard deviation, at these values; and
// what a solver makes of it under the prior.
SweepEvidence Sweep(const CalibrationPrior& prior, double focal, double scale, double sigma) {
  SweepEvidence evidence;
  evidence.information(kProfiledFocal, kProfiledFocal) =
      evidence.information(kProfiledScale, kProfiledScale) = 1.0 / (sigma * sigma);
  CalibrationVector own = CalibrationVector::Zero();
  own[kProfiledFocal] = focal;
  own[kProfiledScale] = scale;
  const CalibrationMatrix both = evidence.information + prior.information;
  evidence.solution = both.llt().solve(evidence.information * own + prior.information * prior.mean);
  return evidence;
}

TEST(SensorProfile, AUnitThatNothingIsKnownOfHasThePriorOfAnyUnit) {
  const SensorProfile profile = ProfileOfAnyUnit(StatedForProfile());
  const CalibrationPrior any = PriorOfAnyUnit();
  EXPECT_EQ(profile.num_sweeps, 0);
  EXPECT_TRUE(profile.mean.isZero());
  EXPECT_NEAR(Sigma(profile, kProfiledFocal), CalibrationModel::kLensSigma[0], 1e-12);
  EXPECT_NEAR(any.information(kProfiledFocal, kProfiledFocal) *
                  profile.covariance(kProfiledFocal, kProfiledFocal),
              1.0, 1e-9);
}

TEST(SensorProfile, GoesToWhatSweepsAgreeOnAndGrowsSurer) {
  SensorProfile profile = ProfileOfAnyUnit(StatedForProfile());
  double last = Sigma(profile, kProfiledFocal);
  for (int sweep = 1; sweep <= 6; ++sweep) {
    const CalibrationPrior prior = PriorOfNextSweep(profile, StatedForProfile(), 0.01);
    profile = Learn(profile, prior, Sweep(prior, 0.0015, -0.008, 1e-4));
    EXPECT_EQ(profile.num_sweeps, sweep);
    EXPECT_LT(Sigma(profile, kProfiledFocal), last) << sweep;
    last = Sigma(profile, kProfiledFocal) +
           1e-5;  // It settles where what changes from sweep to sweep wins.
  }
  EXPECT_NEAR(profile.mean[kProfiledFocal], 0.0015, 2e-5);
  EXPECT_NEAR(profile.mean[kProfiledScale], -0.008, 2e-4);
  // What no sweep showed stays as it was.
  EXPECT_EQ(profile.mean[kLensAt + 4], 0.0);
  EXPECT_GE(Sigma(profile, kLensAt + 4), CalibrationModel::kLensSigma[4]);
}

TEST(SensorProfile, SweepsThatContradictEachOtherMeetBetween) {
  SensorProfile profile = ProfileOfAnyUnit(StatedForProfile());
  for (const double focal : {0.001, 0.002}) {
    const CalibrationPrior prior = PriorOfNextSweep(profile, StatedForProfile(), 0.01);
    profile = Learn(profile, prior, Sweep(prior, focal, 0.0, 1e-4));
  }
  EXPECT_GT(profile.mean[kProfiledFocal], 0.0012);
  EXPECT_LT(profile.mean[kProfiledFocal], 0.0018);
}

// A profile of many sweeps of the cold unit states a small uncertainty of a depth scale that is
// 0.6 % off once the unit is warm. A warm sweep must still come within the interval that
// comparisons state for its solution: three times what the residuals promise.
TEST(SensorProfile, AProfileOfTheColdUnitDoesNotFailTheWarmOnesInterval) {
  constexpr double kWarmUp = 0.006;
  constexpr double kOwnSigma = 0.00067;  // One sweep's, by its residuals.
  const auto error_by_stated = [](const CalibrationPrior& prior) {
    const SweepEvidence warm = Sweep(prior, 0.0, kWarmUp, kOwnSigma);
    const CalibrationMatrix posterior =
        (warm.information + prior.information).llt().solve(CalibrationMatrix::Identity());
    return (kWarmUp - warm.solution[kProfiledScale]) /
           (1.96 * 3.0 * std::sqrt(posterior(kProfiledScale, kProfiledScale)));
  };
  SensorProfile cold = ProfileOfAnyUnit(StatedForProfile());
  for (int sweep = 0; sweep < 200; ++sweep) {
    const CalibrationPrior prior = PriorOfNextSweep(cold, StatedForProfile(), 0.01);
    cold = Learn(cold, prior, Sweep(prior, 0.0, 0.0, kOwnSigma));
  }
  EXPECT_LT(error_by_stated(PriorOfNextSweep(cold, StatedForProfile(), 0.01)), 0.5);
  // Even if it stated none at all, because a prior has at least the variance between two sweeps.
  cold.covariance(kProfiledScale, kProfiledScale) *= 1e-4;
  const CalibrationPrior held = PriorOfNextSweep(cold, StatedForProfile(), 0.01);
  EXPECT_LT(error_by_stated(held), 0.6);
  EXPECT_GT(error_by_stated(held), 0.4);
  CalibrationPrior without = held;
  without.information(kProfiledScale, kProfiledScale) =
      1.0 / cold.covariance(kProfiledScale, kProfiledScale);
  EXPECT_GT(error_by_stated(without), 1.0) << "that variance is needed";
}

TEST(SensorProfile, TheEdgeShiftIsNeverCarriedOver) {
  SensorProfile profile = ProfileOfAnyUnit(StatedForProfile());
  profile.mean[kEdgeBiasAt] = 0.3;
  profile.covariance(kEdgeBiasAt, kProfiledFocal) =
      profile.covariance(kProfiledFocal, kEdgeBiasAt) = 1e-5;
  const CalibrationPrior prior = PriorOfNextSweep(profile, StatedForProfile(), 0.02);
  EXPECT_EQ(prior.mean[kEdgeBiasAt], 0.0);
  EXPECT_NEAR(prior.information(kEdgeBiasAt, kEdgeBiasAt), 1.0 / (0.02 * 0.02), 1e-6);
  EXPECT_NEAR(prior.information(kEdgeBiasAt, kProfiledFocal), 0.0, 1e-9);
}

TEST(SensorProfile, IsRefusedForAnotherCamera) {
  const SensorProfile profile = ProfileOfAnyUnit(StatedForProfile());
  Intrinsics other = StatedForProfile();
  other.fx += 0.01;
  EXPECT_THROW(static_cast<void>(PriorOfNextSweep(profile, other, 0.02)), DataError);
  EXPECT_NO_THROW(static_cast<void>(PriorOfNextSweep(profile, StatedForProfile(), 0.02)));
}

TEST(SensorProfile, IsRefusedWithoutAProperCovariance) {
  SensorProfile profile = ProfileOfAnyUnit(StatedForProfile());
  profile.covariance(kProfiledScale, kProfiledScale) = -1.0;
  EXPECT_THROW(static_cast<void>(PriorOfNextSweep(profile, StatedForProfile(), 0.02)), DataError);
}

}  // namespace
}  // namespace plumb
