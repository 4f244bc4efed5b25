// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/ps1080.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace plumb {
namespace {

int StepAt(int depth_mm) {
  int code = 0;
  while (Ps1080DepthOfCode(code + 1) <= depth_mm) ++code;
  // Over eight codes, because each single depth is truncated to a millimetre.
  return Ps1080DepthOfCode(code + 4) - Ps1080DepthOfCode(code - 4);
}

TEST(Ps1080Test, StepsAreThoseOfAnEighthOfAPixel) {
  // z^2 / (8 b f) with b = 75 mm, f = 575.8 px: 1.42 mm at 0.7 m, 2.89 mm at 1.0 m; truncation adds
  // at most 1 mm to eight steps.
  EXPECT_NEAR(StepAt(700), 8 * 1.42, 1.0);
  EXPECT_NEAR(StepAt(1000), 8 * 2.89, 1.0);
}

TEST(Ps1080Test, FindsTheCodeOfAnExactDepth) {
  for (int code = 400; code < 1000; ++code) {
    const double m = 0.1042 * ((code - 800) / 4.0 - 0.375);
    EXPECT_EQ(QuantisePs1080(9000.0 / (7.5 - m)), Ps1080DepthOfCode(code)) << "code " << code;
  }
}

TEST(Ps1080Test, StaysWithinHalfAStepAndTheTruncation) {
  for (double depth_mm = 450.0; depth_mm < 3000.0; depth_mm += 0.37) {
    const double half_step = 0.5 * depth_mm * depth_mm / (8.0 * 75.0 * 575.8) * 1.01;
    const double error = QuantisePs1080(depth_mm) - depth_mm;
    EXPECT_LE(error, half_step + 1e-9) << depth_mm;
    EXPECT_GE(error, -half_step - 1.0) << depth_mm;
  }
}

}  // namespace
}  // namespace plumb
