// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include <gtest/gtest.h>

#include "algo/base/digits.hpp"

namespace plumb {
namespace {

TEST(DecimalsForTest, NoDigitIsShownBelowTheFirstOneOfTheUncertainty) {
  EXPECT_EQ(DecimalsFor(0.1, 2), 1);
  EXPECT_EQ(DecimalsFor(0.099, 2), 2);
  EXPECT_EQ(DecimalsFor(1.0, 2), 0);
  EXPECT_EQ(DecimalsFor(0.99, 2), 1);
  EXPECT_EQ(DecimalsFor(40.0, 2), 0);
  EXPECT_EQ(DecimalsFor(0.004, 2), 2) << "at most";
  EXPECT_EQ(DecimalsFor(0.0, 1), 1) << "unknown";
  EXPECT_EQ(DecimalsFor(std::numeric_limits<double>::quiet_NaN(), 1), 1);
}

TEST(ShownTest, AValueHasNoDigitBelowItsUncertainty) {
  EXPECT_EQ(ValueWithUncertainty(-2.93, 1.06, 1, '.'), "\u22123 \u00b11.1");
  EXPECT_EQ(ValueWithUncertainty(-2.93, 0.96, 1, '.'), "\u22122.9 \u00b11.0");
  EXPECT_EQ(ValueWithUncertainty(-39.04, 1.1, 1, ','), "\u221239 \u00b11,1");
  EXPECT_EQ(ValueWithUncertainty(-0.814, 0.09, 2, ','), "\u22120,81 \u00b10,09");
  EXPECT_EQ(ValueWithUncertainty(-0.164, 0.12, 2, '.'), "\u22120.2 \u00b10.12");
  EXPECT_EQ(ValueWithUncertainty(-8.0, 0.11, 1, '.'), "\u22128.0 \u00b10.1") << "no more than most";
  EXPECT_EQ(ValueWithUncertainty(-8.0, 0.03, 1, '.'), "\u22128.0 \u00b10.1") << "never nothing";
  EXPECT_EQ(ValueWithUncertainty(-0.02, 1.1, 1, '.'), "0 \u00b11.1") << "zero has no sign";
  EXPECT_EQ(ValueWithUncertainty(4.26, 0.0, 1, '.'), "+4.3") << "no uncertainty is known";
}

TEST(ShownTest, ZeroAndAnUnknownUncertaintyAreKnownAsSuch) {
  EXPECT_TRUE(Shown(-0.04, 0.9, 1, '.').is_zero);
  EXPECT_FALSE(Shown(-0.06, 0.9, 1, '.').is_zero);
  EXPECT_EQ(Shown(-8.04, 0.9, 1, ',').value, "\u22128,0");
  EXPECT_EQ(Shown(-8.04, 0.9, 1, ',').u95, "0,9");
  EXPECT_EQ(Shown(1.0, 0.0, 1, '.').u95, "");
  EXPECT_EQ(PlainNumber(2.5, ','), "2,5");
  EXPECT_EQ(PlainNumber(3.0, ','), "3");
}

}  // namespace
}  // namespace plumb
