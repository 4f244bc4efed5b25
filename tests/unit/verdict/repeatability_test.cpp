// SPDX-License-Identifier: Apache-2.0
#include "algo/verdict/repeatability.hpp"

#include <gmock/gmock.h>

#include "words/repeat.hpp"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::vector<RepeatedSweep> kThree = {{"one", 0.9}, {"two", 1.1}, {"three", {}}};

/// Six numbers of which the first `missed` lie outside their intervals.
RepeatedPair Pair(std::size_t a, std::size_t b, int missed,
                  Verdict verdict = Verdict::kInTolerance) {
  RepeatedPair pair{.reference = a, .current = b, .verdict = verdict};
  for (int i = 0; i < 6; ++i)
    pair.numbers[static_cast<std::size_t>(i)] =
        MeasuredNumber{.value = i < missed ? -1.01 : 1.0, .u95 = 1.0, .words = {}};
  return pair;
}

TEST(Repeatability, ScatterIsThatOfOneSweep) {
  RepeatedPair one = Pair(0, 1, 0), two = Pair(0, 2, 0), three = Pair(1, 2, 0);
  one.numbers[0]->value = 0.3;
  two.numbers[0]->value = -0.4;
  three.numbers[0].reset();
  const Repeatability judged = JudgeRepeats(kThree, {one, two, three});
  EXPECT_NEAR(judged.scatter[0].value(), 0.25, 1e-12);  // sqrt((0.09 + 0.16) / 2 / 2)
  EXPECT_EQ(judged.judged, 17);
  EXPECT_EQ(judged.held, 17);
  EXPECT_TRUE(judged.is_fit());
}

// Of 6 independent intervals one misses in 26 of 100 rows, two in 3.
TEST(Repeatability, IntervalsMayMissAsOftenAsTheySay) {
  const std::vector<RepeatedSweep> two = {{"one"}, {"two"}};
  EXPECT_TRUE(JudgeRepeats(two, {Pair(0, 1, 1)}).is_fit());
  EXPECT_THAT(EnglishTexts(JudgeRepeats(two, {Pair(0, 1, 2)}).reasons),
              ElementsAre(HasSubstr("only 4 of 6 intervals")));
}

// Three pairs of three sweeps are two differences, not three: 3 of 18 are 2 of 12.
TEST(Repeatability, PairsOfTheSameSweepsAreNotIndependent) {
  EXPECT_TRUE(JudgeRepeats(kThree, {Pair(0, 1, 1), Pair(0, 2, 1), Pair(1, 2, 1)}).is_fit());
  EXPECT_FALSE(JudgeRepeats(kThree, {Pair(0, 1, 2), Pair(0, 2, 2), Pair(1, 2, 1)}).is_fit());
}

TEST(Repeatability, AFalseMoveAndARefusalAreNamed) {
  RepeatedPair refused = Pair(0, 1, 0, Verdict::kNoAnswer);
  refused.reasons = {Message::Verbatim("the sheet is in the way")};
  const Repeatability judged =
      JudgeRepeats(kThree, {refused, Pair(0, 2, 0, Verdict::kMove), Pair(1, 2, 0)});
  EXPECT_THAT(EnglishTexts(judged.reasons),
              ElementsAre("one and two cannot be compared: the sheet is in the way",
                          HasSubstr("between one and three a motion is reported")));
}

TEST(Repeatability, ACalibrationThatDoesNotFitIsNamed) {
  const auto reasons = [](double chi2) {
    return JudgeRepeats({{"one", chi2}, {"two", 1.0}}, {Pair(0, 1, 0)}).reasons;
  };
  EXPECT_THAT(reasons(2.0), IsEmpty());
  EXPECT_THAT(EnglishTexts(reasons(2.01)), ElementsAre(HasSubstr("the calibration of one")));
}

TEST(Repeatability, NothingMeasuredIsNotFit) {
  EXPECT_FALSE(JudgeRepeats({}, {}).is_fit());
  RepeatedPair none{.reference = 0, .current = 1, .verdict = Verdict::kUnsure};
  EXPECT_FALSE(JudgeRepeats({{"one"}, {"two"}}, {none}).is_fit());
}

}  // namespace
}  // namespace plumb
