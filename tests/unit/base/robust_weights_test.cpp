// SPDX-License-Identifier: Apache-2.0
#include "algo/base/robust_weights.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(RobustWeightsTest, CauchysLossIsTheSquareOfSmallResidualsAndALogarithmOfLargeOnes) {
  EXPECT_EQ(CauchyLoss(0.0, 2.0), 0.0);
  EXPECT_NEAR(CauchyLoss(1e-6, 2.0), 1e-6, 1e-12);
  EXPECT_DOUBLE_EQ(CauchyLoss(4.0, 2.0), 4.0 * std::log(2.0));
  // Far above the scale, ten times the residual adds a constant: scale^2 log(100).
  EXPECT_NEAR(CauchyLoss(1e10, 2.0) - CauchyLoss(1e8, 2.0), 4.0 * std::log(100.0), 1e-6);
}

TEST(RobustWeightsTest, CauchysWeightIsTheSlopeOfItsLoss) {
  EXPECT_EQ(CauchyWeight(0.0, 3.0), 1.0);
  EXPECT_EQ(CauchyWeight(9.0, 3.0), 0.5);
  for (const double squared : {0.1, 1.0, 4.0, 30.0, 900.0}) {
    for (const double scale : {0.5, 2.0, 3.0}) {
      const double step = 1e-5 * squared;
      const double slope =
          (CauchyLoss(squared + step, scale) - CauchyLoss(squared - step, scale)) / (2 * step);
      // The central difference errs by step^2 of the third derivative: below 1e-9 of the slope.
      EXPECT_NEAR(CauchyWeight(squared, scale), slope, 1e-7 * slope) << squared << ' ' << scale;
    }
  }
}

TEST(RobustWeightsTest, TukeysWeightFallsFromOneToNothingAtTheCut) {
  EXPECT_EQ(TukeyWeight(0.0), 1.0);
  EXPECT_EQ(TukeyWeight(0.5), 0.5625);
  EXPECT_EQ(TukeyWeight(-0.5), 0.5625);
  EXPECT_GT(TukeyWeight(0.999), 0.0);
  EXPECT_EQ(TukeyWeight(1.0), 0.0);
  EXPECT_EQ(TukeyWeight(-1.0), 0.0);
  EXPECT_EQ(TukeyWeight(7.0), 0.0);
}

}  // namespace
}  // namespace plumb
