// SPDX-License-Identifier: Apache-2.0
#include "daemon/sweep/forming_answer.hpp"

#include <future>
#include <stdexcept>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

Comparison Decided(double shift_u95_mm, double rotation_u95_deg) {
  Comparison comparison;
  comparison.verdict = Verdict::kMove;
  comparison.limits.shift_tolerance_m = 5 * kMillimetre;
  comparison.limits.rotation_tolerance_rad = 3 * kDegree;
  comparison.correction.emplace();
  comparison.correction->value = {7, -2, 3, 0.1, 0.2, 0.3};
  comparison.correction->u95 = {shift_u95_mm,     shift_u95_mm,     shift_u95_mm,
                                rotation_u95_deg, rotation_u95_deg, rotation_u95_deg};
  return comparison;
}

TEST(FormingAnswerTest, IsEnoughWhenDecidedWithEveryIntervalBelowHalfItsTolerance) {
  EXPECT_TRUE(FormingAnswerOf(Decided(2.49, 1.49), 4).is_enough);
  EXPECT_FALSE(FormingAnswerOf(Decided(2.51, 1.49), 4).is_enough);
  EXPECT_FALSE(FormingAnswerOf(Decided(2.49, 1.51), 4).is_enough);
  Comparison one_is_wide = Decided(1, 1);
  one_is_wide.correction->u95.yaw_deg = 1.51;
  EXPECT_FALSE(FormingAnswerOf(one_is_wide, 4).is_enough);
  Comparison unsure = Decided(1, 1);
  unsure.verdict = Verdict::kUnsure;
  EXPECT_FALSE(FormingAnswerOf(unsure, 4).is_enough);
  unsure.verdict = Verdict::kInTolerance;
  EXPECT_TRUE(FormingAnswerOf(unsure, 4).is_enough);
}

TEST(FormingAnswerTest, StatesTheSixNumbersAndTheirTolerances) {
  const FormingAnswer answer = FormingAnswerOf(Decided(2, 1), 4.5);
  EXPECT_EQ(answer.sweep_s, 4.5);
  EXPECT_DOUBLE_EQ(answer.shift_tolerance_mm, 5);
  EXPECT_DOUBLE_EQ(answer.rotation_tolerance_deg, 3);
  ASSERT_TRUE(answer.numbers.has_value());
  EXPECT_EQ(answer.numbers->value, (std::array{7.0, -2.0, 3.0, 0.1, 0.2, 0.3}));
  EXPECT_EQ(answer.numbers->u95, (std::array{2.0, 2.0, 2.0, 1.0, 1.0, 1.0}));
}

TEST(FormingAnswerTest, HasNoNumbersWithoutAnAnswerOrWithoutShifts) {
  Comparison refused = Decided(1, 1);
  refused.verdict = Verdict::kNoAnswer;
  EXPECT_FALSE(FormingAnswerOf(refused, 4).numbers.has_value());
  EXPECT_FALSE(FormingAnswerOf(refused, 4).is_enough);
  Comparison on_couch = Decided(1, 1);
  on_couch.correction->value.lateral_mm.reset();
  EXPECT_FALSE(FormingAnswerOf(on_couch, 4).numbers.has_value());
  EXPECT_FALSE(FormingAnswerOf(on_couch, 4).is_enough);
}

void WaitUntilIdle(const FormingAnswers& answers) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!answers.IsIdle() && std::chrono::steady_clock::now() < end) std::this_thread::yield();
  ASSERT_TRUE(answers.IsIdle());
}

TEST(FormingAnswersTest, KeepsTheLastAnswerOverOneThatFails) {
  bool refuses = false;
  FormingAnswers answers([&](const Scene&, const std::stop_token&) {
    Comparison comparison = Decided(1, 1);
    if (refuses) comparison.verdict = Verdict::kNoAnswer;
    return comparison;
  });
  EXPECT_FALSE(answers.Newest().has_value());
  answers.Make([](const std::stop_token&) { return Scene(); }, 3);
  WaitUntilIdle(answers);
  ASSERT_TRUE(answers.Newest().has_value());
  EXPECT_TRUE(answers.Newest()->is_enough);
  answers.Make([](const std::stop_token&) -> Scene { throw std::runtime_error("too little"); }, 4);
  WaitUntilIdle(answers);
  EXPECT_EQ(answers.Newest()->sweep_s, 3);
  EXPECT_TRUE(answers.Newest()->is_enough);
  refuses = true;
  answers.Make([](const std::stop_token&) { return Scene(); }, 5);
  WaitUntilIdle(answers);
  EXPECT_EQ(answers.Newest()->sweep_s, 3);
  EXPECT_FALSE(answers.Newest()->is_enough);
  refuses = false;
  answers.Make([](const std::stop_token&) { return Scene(); }, 6);
  WaitUntilIdle(answers);
  EXPECT_EQ(answers.Newest()->sweep_s, 6);
}

TEST(FormingAnswersTest, StopEndsWhatIsBeingMade) {
  std::promise<void> begun;
  FormingAnswers answers([](const Scene&, const std::stop_token&) { return Decided(1, 1); });
  answers.Make(
      [&](const std::stop_token& stop) {
        begun.set_value();
        while (!stop.stop_requested()) std::this_thread::yield();
        return Scene();
      },
      3);
  begun.get_future().wait();
  EXPECT_FALSE(answers.IsIdle());
  answers.Stop();  // without it the destructor would still end it; here the scan goes on
  WaitUntilIdle(answers);
}

}  // namespace
}  // namespace plumb
