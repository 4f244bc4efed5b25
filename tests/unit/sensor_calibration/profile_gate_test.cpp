// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/profile_gate.hpp"

#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "algo/base/errors.hpp"

namespace plumb {
namespace {

constexpr int kFocal = kLensAt;
constexpr int kScale = kDepthAt + kDepthScale;

Intrinsics Stated() {
  Intrinsics k;
  k.width = 640;
  k.height = 480;
  return k;
}

// What a solver makes of a sweep that sees two terms at these values, each this sharply.
SensorProfile After(const SensorProfile& before, double focal, double scale, double sigma) {
  const CalibrationPrior prior = PriorOfNextSweep(before, Stated(), 0.02);
  SweepEvidence evidence;
  evidence.information(kFocal, kFocal) = evidence.information(kScale, kScale) =
      1.0 / (sigma * sigma);
  CalibrationVector own = CalibrationVector::Zero();
  own[kFocal] = focal;
  own[kScale] = scale;
  const CalibrationMatrix both = evidence.information + prior.information;
  evidence.solution = both.llt().solve(evidence.information * own + prior.information * prior.mean);
  return Learn(before, prior, evidence);
}

SensorProfile Known() {
  SensorProfile profile = ProfileOfAnyUnit(Stated());
  for (int sweep = 0; sweep < 5; ++sweep) profile = After(profile, 0.0015, -0.008, 1e-4);
  return profile;
}

TEST(ProfileGate, TheLimitIsTheChiSquareDistributionsOwn) {
  EXPECT_EQ(ChiSquareLimit(0), 0.0);
  // Tabulated values of the 99.9 % quantile.
  EXPECT_NEAR(ChiSquareLimit(1), 10.828, 0.031 * 10.828);
  EXPECT_NEAR(ChiSquareLimit(2), 13.816, 0.023 * 13.816);
  EXPECT_NEAR(ChiSquareLimit(10), 29.588, 0.006 * 29.588);
  EXPECT_NEAR(ChiSquareLimit(50), 86.661, 0.001 * 86.661);
}

TEST(ProfileGate, ASweepThatRepeatsTheProfileAgrees) {
  const SensorProfile known = Known();
  const ProfileAgreement agreement =
      Agreement(known, After(known, known.mean[kFocal], known.mean[kScale], 1e-4));
  EXPECT_EQ(agreement.num_terms, 2);
  EXPECT_LT(agreement.chi_square, 0.01);
  EXPECT_TRUE(agreement.agrees());
}

// One term, so that the boundary can be computed: the move of a sweep's own value has the prior's
// variance with the sweep's, which Learn() takes to be three times as wide as it promises.
TEST(ProfileGate, JustWithinTheLimitAgreesAndJustBeyondDoesNot) {
  const SensorProfile known = Known();
  const double drift = DriftBetweenSweeps()[kFocal];
  const double sigma = 1e-4;
  const double spread =
      std::sqrt(known.covariance(kFocal, kFocal) + drift * drift + 9.0 * sigma * sigma);
  const double limit = std::sqrt(ChiSquareLimit(2));
  const auto at = [&](double share) {
    return Agreement(known, After(known, known.mean[kFocal] + share * limit * spread,
                                  known.mean[kScale], sigma));
  };
  EXPECT_TRUE(at(0.98).agrees()) << at(0.98).chi_square;
  EXPECT_FALSE(at(1.02).agrees()) << at(1.02).chi_square;
}

TEST(ProfileGate, RefusesOneSweepOfTheSameUnitInAThousand) {
  const SensorProfile known = Known();
  const double sigma = 1e-4;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto draw = [&](int term) {
    const double drift = DriftBetweenSweeps()[term];
    return known.mean[term] + normal(random) * std::sqrt(known.covariance(term, term) +
                                                         drift * drift + 9.0 * sigma * sigma);
  };
  int refused = 0;
  constexpr int kSweeps = 2000;
  for (int i = 0; i < kSweeps; ++i)
    refused += Agreement(known, After(known, draw(kFocal), draw(kScale), sigma)).agrees() ? 0 : 1;
  EXPECT_LE(refused, 8);  // 2 expected; more than 8 come once in 4000 such tests
}

TEST(ProfileGate, TheLightsShiftOfMarkerEdgesTakesNoPart) {
  const SensorProfile known = Known();
  SensorProfile after = After(known, known.mean[kFocal], known.mean[kScale], 1e-4);
  after.mean[kEdgeBiasAt] = 5.0;
  EXPECT_TRUE(Agreement(known, after).agrees());
}

// A sweep determines the scale of depth to 0.07 % by its own residuals, and three times that counts
// (measured on simulated sweeps, on which a first one leaves 0.2 %). A warm-up changes it by up to
// 0.6 %.
constexpr double kScaleOfOneSweep = 0.00067;
constexpr double kScaleOfWarmUp = 0.006;

SensorProfile LearnedCold(int num_sweeps) {
  SensorProfile profile = ProfileOfAnyUnit(Stated());
  for (int i = 0; i < num_sweeps; ++i) profile = After(profile, 0.0, 0.0, kScaleOfOneSweep);
  return profile;
}

TEST(ProfileGate, AWarmUpDoesNotContradictAProfileOfTheColdUnitAndAWrongDepthScaleDoes) {
  for (const int num_sweeps : {1, 3, 200}) {
    const SensorProfile cold = LearnedCold(num_sweeps);
    const auto at = [&](double scale) {
      return Agreement(cold, After(cold, 0.0, scale, kScaleOfOneSweep));
    };
    EXPECT_TRUE(at(kScaleOfWarmUp).agrees())
        << num_sweeps << " sweeps: " << at(kScaleOfWarmUp).chi_square;
    EXPECT_TRUE(at(-kScaleOfWarmUp).agrees()) << num_sweeps;
    EXPECT_FALSE(at(2 * kScaleOfWarmUp).agrees())
        << num_sweeps << ": " << at(2 * kScaleOfWarmUp).chi_square;
  }
}

TEST(ProfileGate, WithAgeAProfileIsHeldLessTightly) {
  const SensorProfile known = Known();
  const double before = known.covariance(kFocal, kFocal);
  EXPECT_EQ(Aged(known, 0).covariance, known.covariance);
  EXPECT_EQ(Aged(known, -5).covariance, known.covariance) << "the clock was set back";
  const double drift = DriftBetweenSweeps()[kFocal];
  EXPECT_NEAR(Aged(known, 30).covariance(kFocal, kFocal), before + drift * drift, 1e-15);
  EXPECT_EQ(Aged(known, 1e9).covariance, Aged(known, 3650).covariance);
  EXPECT_EQ(Aged(known, 1000).mean, known.mean);
  // What contradicts yesterday's profile need not contradict last year's.
  const double moved = known.mean[kFocal] + 0.0025;
  EXPECT_FALSE(Agreement(known, After(known, moved, known.mean[kScale], 1e-4)).agrees());
  const SensorProfile old = Aged(known, 3650);
  EXPECT_TRUE(Agreement(old, After(old, moved, known.mean[kScale], 1e-4)).agrees());
}

TEST(ProfileGate, WithoutAProperCovarianceThereIsNoAnswer) {
  SensorProfile broken = Known();
  const SensorProfile after = broken;
  broken.covariance(kScale, kScale) = -1.0;
  EXPECT_THROW(static_cast<void>(Agreement(broken, after)), DataError);
}

}  // namespace
}  // namespace plumb
