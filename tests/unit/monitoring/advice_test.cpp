// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/advice.hpp"

#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

constexpr double kFrame_s = 1.0 / 30.0;

LiveNumbers Lateral(double value_mm, double u95_mm = 0.5) {
  LiveNumbers numbers;
  numbers.value[0] = value_mm * kMillimetre;
  numbers.u95.head<3>().setConstant(u95_mm * kMillimetre);
  numbers.u95.tail<3>().setConstant(0.1 * kDegree);
  return numbers;
}

class AdviceTest : public testing::Test {
 protected:
  LiveAdvice Next(const std::optional<LiveNumbers>& numbers) {
    time_s_ += kFrame_s;
    return filter_.Next(time_s_, numbers);
  }
  void ComeIn() {
    const double start_s = time_s_;
    while (Next(Lateral(0.0)) != LiveAdvice::kIn) ASSERT_LT(time_s_, start_s + 2.0);
  }

  AdviceFilter filter_{AcceptanceLimits{}};  // 3 mm, 1 deg
  double time_s_ = 0.0;
};

TEST_F(AdviceTest, InComesAfterOneSecondInside) {
  ComeIn();
  EXPECT_NEAR(time_s_, 1.0 + kFrame_s, 1.5 * kFrame_s);
}

TEST_F(AdviceTest, OneFrameOutsideIsOutAtOnce) {
  ComeIn();
  EXPECT_EQ(Next(Lateral(3.01)), LiveAdvice::kOut);
  EXPECT_EQ(Next(Lateral(0.0)), LiveAdvice::kOut) << "and stays so for a second";
}

TEST_F(AdviceTest, TwoFramesThatAreNotSurelyInsideAreOut) {
  ComeIn();
  EXPECT_EQ(Next(Lateral(2.9)), LiveAdvice::kIn);
  EXPECT_EQ(Next(Lateral(0.0)), LiveAdvice::kIn);
  EXPECT_EQ(Next(Lateral(2.9)), LiveAdvice::kIn);
  EXPECT_EQ(Next(Lateral(2.9)), LiveAdvice::kOut);
}

TEST_F(AdviceTest, NumbersThatAreNotSureNeverComeIn) {
  for (int i = 0; i < 100; ++i) EXPECT_NE(Next(Lateral(0.0, 2.5)), LiveAdvice::kIn);
}

TEST_F(AdviceTest, UnknownNumbersAndLongGapsAreUnknown) {
  ComeIn();
  EXPECT_EQ(Next(std::nullopt), LiveAdvice::kUnknown);
  EXPECT_EQ(Next(Lateral(0.0)), LiveAdvice::kUnknown) << "not in before another second";
  ComeIn();
  time_s_ += 0.2;
  EXPECT_EQ(Next(Lateral(0.0)), LiveAdvice::kUnknown);
}

TEST_F(AdviceTest, AnUncertaintyThatNobodyStatedIsUnknown) {
  ComeIn();
  EXPECT_EQ(Next(Lateral(0.0, 0.0)), LiveAdvice::kUnknown);
}

}  // namespace
}  // namespace plumb
