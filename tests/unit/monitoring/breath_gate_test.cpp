// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/breath_gate.hpp"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

constexpr double kOfFrame_s = 1.0 / 30.0;
constexpr double kWindow_m = 3.5 * kMillimetre;

class BreathGateTest : public testing::Test {
 protected:
  LiveAdvice Next(std::optional<double> height_mm) {
    time_s_ += kOfFrame_s;
    return gate_.Next(time_s_, height_mm ? std::optional(*height_mm * kMillimetre) : std::nullopt);
  }
  /// The last advice of a time in which the height is a function of the seconds in it.
  LiveAdvice For(double seconds, const std::function<double(double)>& height_mm) {
    LiveAdvice last = LiveAdvice::kUnknown;
    for (double at = 0; at < seconds - 1e-9; at += kOfFrame_s) last = Next(height_mm(at));
    return last;
  }
  void TeachFifteen() {
    (void)For(1.5, [](double) { return 15.0; });
    ASSERT_TRUE(gate_.Teach(kWindow_m));
  }

  BreathGate gate_;
  double time_s_ = 100.0;
};

TEST_F(BreathGateTest, ASettledBreathIsTakenAsLevel) {
  EXPECT_FALSE(gate_.Teach(kWindow_m)) << "nothing was seen yet";
  // Noise of 0.3 mm, as measured, alternating.
  (void)For(1.5, [](double at) { return 15.0 + (std::fmod(at, 0.1) < 0.05 ? 0.3 : -0.3); });
  const std::optional<BreathWindow> window = gate_.Teach(kWindow_m);
  ASSERT_TRUE(window);
  EXPECT_NEAR(window->level_m / kMillimetre, 15.0, 0.1);
  EXPECT_EQ(window->width_m, kWindow_m);
}

TEST_F(BreathGateTest, ABreathThatIsNotHeldIsNotTaken) {
  (void)For(2.0, [](double at) { return 3.0 * at; });
  EXPECT_FALSE(gate_.Teach(kWindow_m)) << "3 mm/s";
  (void)For(2.0, [](double at) { return 10.0 + 1.5 * std::sin(12 * at); });
  EXPECT_FALSE(gate_.Teach(kWindow_m)) << "it goes up and down by 3 mm";
  (void)For(1.5, [](double) { return 15.0; });
  (void)Next(std::nullopt);
  (void)For(0.5, [](double) { return 15.0; });
  EXPECT_FALSE(gate_.Teach(kWindow_m)) << "known for half a second only";
  EXPECT_FALSE(gate_.window());
}

TEST_F(BreathGateTest, ComesInAfterHalfASecondAndLeavesAtTheFirstFrameOutside) {
  TeachFifteen();
  EXPECT_EQ(For(1.0, [](double) { return 2.0; }), LiveAdvice::kOut);
  EXPECT_EQ(For(0.45, [](double) { return 15.0; }), LiveAdvice::kOut);
  EXPECT_EQ(For(0.2, [](double) { return 15.0; }), LiveAdvice::kIn);
  // On both sides of the limit, above and below.
  EXPECT_EQ(Next(15.0 + 1.7), LiveAdvice::kIn);
  EXPECT_EQ(Next(15.0 + 1.8), LiveAdvice::kOut);
  EXPECT_EQ(Next(15.0), LiveAdvice::kOut) << "not at once again";
  EXPECT_EQ(For(0.7, [](double) { return 15.0; }), LiveAdvice::kIn);
  EXPECT_EQ(Next(15.0 - 1.7), LiveAdvice::kIn);
  EXPECT_EQ(Next(15.0 - 1.8), LiveAdvice::kOut);
}

TEST_F(BreathGateTest, PassingThroughIsNotIn) {
  TeachFifteen();
  (void)For(1.0, [](double) { return 5.0; });
  // 2.5 mm/s takes 1.4 s through the window.
  for (double at = 0; at < 8; at += kOfFrame_s)
    EXPECT_EQ(Next(5.0 + 2.5 * at), LiveAdvice::kOut) << at;
}

TEST_F(BreathGateTest, AnUnknownHeightIsUnknownAndBeginsAnew) {
  TeachFifteen();
  EXPECT_EQ(For(1.0, [](double) { return 15.0; }), LiveAdvice::kIn);
  EXPECT_EQ(Next(std::nullopt), LiveAdvice::kUnknown);
  EXPECT_EQ(Next(15.0), LiveAdvice::kOut);
  EXPECT_EQ(For(1.0, [](double) { return 15.0; }), LiveAdvice::kIn);
  time_s_ += 0.2;  // a gap
  EXPECT_EQ(Next(15.0), LiveAdvice::kOut);
  gate_.Forget();
  EXPECT_EQ(Next(40.0), LiveAdvice::kIn) << "no gate any more";
}

TEST(WithBreathTest, BothGatesHoldAndUnknownCountsMost) {
  using enum LiveAdvice;
  EXPECT_EQ(WithBreath(kIn, std::nullopt), kIn);
  EXPECT_EQ(WithBreath(kOut, std::nullopt), kOut);
  EXPECT_EQ(WithBreath(kIn, kIn), kIn);
  EXPECT_EQ(WithBreath(kIn, kOut), kOut);
  EXPECT_EQ(WithBreath(kIn, kUnknown), kUnknown);
  EXPECT_EQ(WithBreath(kOut, kIn), kOut);
  EXPECT_EQ(WithBreath(kOut, kUnknown), kUnknown);
  EXPECT_EQ(WithBreath(kUnknown, kIn), kUnknown);
  EXPECT_EQ(WithBreath(kUnknown, kOut), kUnknown);
}

}  // namespace
}  // namespace plumb
