// SPDX-License-Identifier: Apache-2.0
#include "algo/verdict/gates.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "words/comparison.hpp"
#include "words/direction.hpp"

namespace plumb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A comparison that every gate lets pass, and whose values are all zero.
Evidence GoodEvidence() {
  Evidence evidence;
  evidence.markers.good = 3;
  evidence.markers.shared_ids = {4, 7, 9};
  evidence.reference_has_support = true;
  evidence.coverage = 1.0;
  evidence.largest_hole_m = 0.0;
  evidence.residual_p95_m = 0.001;
  evidence.reference_lost_s = 0.0;
  evidence.current_lost_s = 0.0;
  evidence.numbers.fill(MeasuredNumber{0.0, 0.1, say::direction::Up()});
  return evidence;
}

Verdict VerdictOf(const Evidence& evidence, const AcceptanceLimits& limits = {}) {
  const Decision decision = Decide(evidence, limits);
  EXPECT_FALSE(decision.reasons.empty());
  return decision.verdict;
}

// One gate at its boundary: `good` must pass, `bad` must refuse with its own reason.
void ExpectGate(const Evidence& good, const Evidence& bad, const char* reason) {
  EXPECT_EQ(VerdictOf(good), Verdict::kInTolerance) << reason;
  const Decision refused = Decide(bad, {});
  EXPECT_EQ(refused.verdict, Verdict::kNoAnswer) << reason;
  EXPECT_THAT(EnglishTexts(refused.reasons), ElementsAre(HasSubstr(reason)));
}

// The same for a gate on one number of the evidence; what was not measured must be refused too.
void ExpectGate(double Evidence::*field, double good, double bad, const char* reason) {
  Evidence passes = GoodEvidence();
  passes.*field = good;
  Evidence refused = GoodEvidence();
  refused.*field = bad;
  ExpectGate(passes, refused, reason);
  Evidence unknown = GoodEvidence();
  unknown.*field = kNan;
  EXPECT_EQ(VerdictOf(unknown), Verdict::kNoAnswer) << reason;
}

TEST(AcceptanceTest, GoodEvidenceIsInTolerance) {
  const Decision decision = Decide(GoodEvidence(), {});
  EXPECT_EQ(decision.verdict, Verdict::kInTolerance);
  EXPECT_THAT(EnglishTexts(decision.reasons),
              ElementsAre("every value and its uncertainty lie within 3 mm and 1 deg"));
}

TEST(AcceptanceTest, NothingMeasuredIsNoAnswer) {
  EXPECT_EQ(VerdictOf(Evidence{}), Verdict::kNoAnswer);
}

TEST(AcceptanceTest, CoverageAtItsBoundary) {
  ExpectGate(&Evidence::coverage, 0.901, 0.899, "covers 89.9 % of the region");
  ExpectGate(&Evidence::coverage, 0.9, 0.89999, "of the region");
}

TEST(AcceptanceTest, HoleAtItsBoundary) {
  ExpectGate(&Evidence::largest_hole_m, 0.049, 0.051, "hole of 51 mm in the region; at most 50 mm");
}

TEST(AcceptanceTest, AHoleIsNamedByThePartOfTheBodyItLiesOn) {
  Evidence evidence = GoodEvidence();
  evidence.largest_hole_m = 0.051;
  evidence.hole_place = Message::Verbatim("left shoulder");
  EXPECT_THAT(EnglishTexts(Decide(evidence, {}).reasons),
              ElementsAre("the current scan has a hole of 51 mm in the region (left shoulder); at "
                          "most 50 mm are allowed; sweep over it"));
}

TEST(AcceptanceTest, ResidualAtItsBoundary) {
  ExpectGate(&Evidence::residual_p95_m, 0.024, 0.026, "does not look like this reference");
}

TEST(AcceptanceTest, LostTrackingOfEitherScanAtItsBoundary) {
  ExpectGate(&Evidence::reference_lost_s, 0.99, 1.01, "in the reference scan");
  ExpectGate(&Evidence::current_lost_s, 0.99, 1.01, "in the current scan");
}

TEST(AcceptanceTest, BreathingDuringEitherScanAtItsBoundary) {
  ExpectGate(&Evidence::reference_breathing_m, 0.0079, 0.0081,
             "chest and belly rose by 8.1 mm in the reference scan, at most 8 mm are allowed");
  ExpectGate(&Evidence::current_breathing_m, 0.008, 0.00801, "in the current scan");
}

TEST(AcceptanceTest, TooFewSharedMarkers) {
  Evidence two = GoodEvidence();
  two.markers.shared_ids = {4, 7};
  two.markers.good = 2;
  ExpectGate(GoodEvidence(), two, "shared with the reference, found 2 (ids 4, 7)");
}

TEST(AcceptanceTest, TooFewMarkersThatStayed) {
  Evidence moved = GoodEvidence();
  moved.markers.shared_ids = {4, 7, 9, 11};
  EXPECT_EQ(VerdictOf(moved), Verdict::kInTolerance);
  moved.markers.good = 2;
  ExpectGate(GoodEvidence(), moved, "2 of 4 shared ones agree");
}

TEST(AcceptanceTest, TwoGroupsOfMarkersThatDisagree) {
  Evidence two_groups = GoodEvidence();
  two_groups.markers.shared_ids = {1, 2, 3, 4, 5, 6};
  two_groups.markers.two_groups = true;
  ExpectGate(GoodEvidence(), two_groups, "two groups of 3");
}

TEST(AcceptanceTest, AMovedMarkerThatTheAlignmentUsed) {
  Evidence moved = GoodEvidence();
  moved.markers.moved_used = {7};
  ExpectGate(GoodEvidence(), moved, "marker 7 moved since the reference");
}

TEST(AcceptanceTest, WithoutASupportOnlyADrawnRegionIsJudged) {
  Evidence drawn = GoodEvidence();
  drawn.reference_has_support = false;
  drawn.region_is_drawn = true;
  Evidence segmented = drawn;
  segmented.region_is_drawn = false;
  ExpectGate(drawn, segmented, "no flat support was found in the reference scan");
}

TEST(AcceptanceTest, EveryUncertaintyAtItsBoundaryShiftsAndRotationsAlike) {
  for (std::size_t i = 0; i < 6; ++i) {
    const double tolerance = IsShift(i) ? 3.0 : 1.0;
    Evidence wide = GoodEvidence();
    wide.numbers[i]->u95 = 0.99 * tolerance;
    EXPECT_EQ(VerdictOf(wide), Verdict::kInTolerance) << kNumberNames[i];
    wide.numbers[i]->u95 = 1.01 * tolerance;
    const Decision refused = Decide(wide, {});
    EXPECT_EQ(refused.verdict, Verdict::kNoAnswer) << kNumberNames[i];
    EXPECT_THAT(EnglishTexts(refused.reasons), ElementsAre(HasSubstr(kNumberNames[i])));
    for (const double unknown : {kNan, -0.1, 0.0}) {
      wide.numbers[i]->u95 = unknown;
      EXPECT_EQ(VerdictOf(wide), Verdict::kNoAnswer) << kNumberNames[i] << " " << unknown;
    }
  }
}

TEST(AcceptanceTest, EveryValueAtItsTolerance) {
  for (std::size_t i = 0; i < 6; ++i) {
    const double tolerance = IsShift(i) ? 3.0 : 1.0;
    const double u95 = tolerance / 15;  // 0.2 mm
    for (const double sign : {-1.0, 1.0}) {
      Evidence evidence = GoodEvidence();
      const auto verdict_at = [&](double value) {
        evidence.numbers[i] = MeasuredNumber{sign * value * tolerance, u95, say::direction::Up()};
        return VerdictOf(evidence);
      };
      EXPECT_EQ(verdict_at(2.7 / 3), Verdict::kInTolerance) << kNumberNames[i];  // 2.7 + 0.2 mm
      EXPECT_EQ(verdict_at(2.9 / 3), Verdict::kUnsure) << kNumberNames[i];       // 2.9 + 0.2 mm
      EXPECT_EQ(verdict_at(3.1 / 3), Verdict::kMove) << kNumberNames[i];
      EXPECT_EQ(verdict_at(kNan), Verdict::kNoAnswer) << kNumberNames[i];
    }
  }
}

TEST(AcceptanceTest, WhatMakesANumberTooUncertainIsSaidOnceAndOnlyThen) {
  Evidence evidence = GoodEvidence();
  evidence.shift_doubt = say::comparison::CauseSensor();
  evidence.turn_doubt = say::comparison::CauseMarkers(4.0);
  EXPECT_THAT(EnglishTexts(Decide(evidence, {}).reasons), ElementsAre(HasSubstr("every value")));
  evidence.numbers[0]->u95 = evidence.numbers[2]->u95 = 3.1;
  EXPECT_THAT(EnglishTexts(Decide(evidence, {}).reasons),
              ElementsAre(HasSubstr("vertical"), HasSubstr("lateral"), HasSubstr("profile")));
  evidence.numbers[0]->u95 = evidence.numbers[2]->u95 = 0.5;
  evidence.numbers[4]->u95 = 1.1;
  EXPECT_THAT(EnglishTexts(Decide(evidence, {}).reasons),
              ElementsAre(HasSubstr("roll"), HasSubstr("by 4.0 mm")));
}

TEST(AcceptanceTest, TheScanThatKnowsItsMarkersMuchWorseIsNamedWhereANumberIsTooUncertain) {
  const auto reasons = [](double reference_m, double current_m, double u95) {
    Evidence evidence = GoodEvidence();
    evidence.reference_markers_sigma_m = reference_m;
    evidence.current_markers_sigma_m = current_m;
    evidence.numbers[0]->u95 = u95;
    return EnglishTexts(Decide(evidence, {}).reasons);
  };
  EXPECT_THAT(
      reasons(0.0004, 0.00061, 3.1),
      ElementsAre(HasSubstr("vertical"), HasSubstr("the current scan is the poorer one: its "
                                                   "markers are located to within 0.61 mm, "
                                                   "those of the other scan to 0.40 mm")));
  EXPECT_THAT(reasons(0.0012, 0.0004, 3.1),
              ElementsAre(HasSubstr("vertical"), HasSubstr("the reference scan is the poorer")));
  EXPECT_THAT(reasons(0.0004, 0.00059, 3.1), ElementsAre(HasSubstr("vertical")));
  EXPECT_THAT(reasons(kNan, 0.0005, 3.1), ElementsAre(HasSubstr("vertical")));
  EXPECT_THAT(reasons(0.0004, 0.0012, 0.5), ElementsAre(HasSubstr("every value")));
}

TEST(AcceptanceTest, ABodyThatDoesNotFitIsNotBlamedWhereTheMarkersDisagreeToo) {
  const auto reason = [](double rms_m) {
    Evidence evidence = GoodEvidence();
    evidence.residual_p95_m = 0.03;
    evidence.markers_rms_m = rms_m;
    return Decide(evidence, {}).reasons.at(0).English();
  };
  EXPECT_THAT(reason(0.0026),
              ::testing::AllOf(HasSubstr("either it is another body"), HasSubstr("2.6 mm")));
  EXPECT_THAT(reason(0.0024), ::testing::Not(HasSubstr("either")));
  EXPECT_THAT(reason(kNan), ::testing::Not(HasSubstr("either")));
}

TEST(AcceptanceTest, AnUncertaintyIsWrittenWithoutAnExponent) {
  const auto reason = [](std::size_t i, double u95) {
    Evidence wide = GoodEvidence();
    wide.numbers[i]->u95 = u95;
    return Decide(wide, {}).reasons.at(0).English();
  };
  EXPECT_EQ(reason(2, 263.2),
            "lateral is not well determined: \u00b1263 mm at 95 %, the tolerance is 3 mm");
  EXPECT_EQ(reason(2, 99.94),
            "lateral is not well determined: \u00b199.9 mm at 95 %, the tolerance is 3 mm");
  EXPECT_EQ(reason(3, 1.04),
            "pitch is not well determined: \u00b11.04 deg at 95 %, the tolerance is 1 deg");
}

TEST(AcceptanceTest, ReasonsNameTheValuesThatDecide) {
  Evidence evidence = GoodEvidence();
  evidence.numbers[1] = MeasuredNumber{-2.9, 0.25, say::direction::AwayFromGantry()};
  EXPECT_THAT(EnglishTexts(Decide(evidence, {}).reasons),
              ElementsAre("not certainly within 3 mm and 1 deg: longitudinal -2.9 \u00b10.2 mm"));
  evidence.numbers[5] = MeasuredNumber{1.5, 0.1, say::direction::HeadToPatientLeft()};
  EXPECT_THAT(EnglishTexts(Decide(evidence, {}).reasons),
              ElementsAre("outside 3 mm and 1 deg: yaw +1.5 deg (head to patient left)"));
}

TEST(AcceptanceTest, RefusedShiftsAreNotJudgedButRotationsAre) {
  Evidence couch = GoodEvidence();
  for (std::size_t i = 0; i < 3; ++i) couch.numbers[i].reset();
  EXPECT_EQ(VerdictOf(couch), Verdict::kInTolerance);
  couch.numbers[4]->value = 1.2;
  EXPECT_EQ(VerdictOf(couch), Verdict::kMove);
  couch.numbers[4].reset();
  EXPECT_EQ(VerdictOf(couch), Verdict::kNoAnswer);
}

TEST(AcceptanceTest, GatesComeBeforeValuesAndInTheirOrder) {
  Evidence evidence = GoodEvidence();
  evidence.numbers[0]->value = 50;
  evidence.current_lost_s = 6;
  evidence.coverage = 0.5;
  const Decision decision = Decide(evidence, {});
  EXPECT_EQ(decision.verdict, Verdict::kNoAnswer);
  EXPECT_THAT(EnglishTexts(decision.reasons),
              ElementsAre(HasSubstr("covers"), HasSubstr("tracking was lost for 6.0 s")));
  evidence.failure = Message::Verbatim("there is no alignment");
  EXPECT_THAT(EnglishTexts(Decide(evidence, {}).reasons), ElementsAre("there is no alignment"));
}

TEST(AcceptanceTest, LimitsActWhereTheyAreSet) {
  AcceptanceLimits limits{.shift_tolerance_m = 0.002,
                          .rotation_tolerance_rad = 0.5 * kDegree,
                          .min_shared_markers = 4,
                          .min_coverage = 0.8,
                          .max_hole_m = 0.02,
                          .max_residual_p95_m = 0.01,
                          .max_lost_s = 0.5,
                          .max_breathing_m = 0.002};
  Evidence evidence = GoodEvidence();
  evidence.coverage = 0.85;
  evidence.largest_hole_m = 0.03;
  evidence.residual_p95_m = 0.015;
  evidence.reference_lost_s = 0.7;
  evidence.current_breathing_m = 0.003;
  evidence.numbers[2]->u95 = 2.5;
  evidence.numbers[3]->u95 = 0.7;
  EXPECT_THAT(EnglishTexts(Decide(evidence, limits).reasons), SizeIs(7));  // all but the coverage
  limits = {};
  limits.min_coverage = 0.8;
  EXPECT_EQ(VerdictOf(evidence, limits), Verdict::kInTolerance);
}

TEST(AcceptanceTest, ImpossibleLimitsAreTheCallersMistake) {
  EXPECT_NO_THROW(CheckLimits({}));
  for (const double bad : {0.0, -1.0, kNan, HUGE_VAL}) {
    EXPECT_THROW(CheckLimits({.shift_tolerance_m = bad}), std::invalid_argument);
    EXPECT_THROW(CheckLimits({.rotation_tolerance_rad = bad}), std::invalid_argument);
    EXPECT_THROW(CheckLimits({.max_hole_m = bad}), std::invalid_argument);
    EXPECT_THROW(CheckLimits({.max_residual_p95_m = bad}), std::invalid_argument);
    EXPECT_THROW(CheckLimits({.max_lost_s = bad}), std::invalid_argument);
    EXPECT_THROW(CheckLimits({.max_breathing_m = bad}), std::invalid_argument);
  }
  EXPECT_THROW(CheckLimits({.min_shared_markers = 0}), std::invalid_argument);
  EXPECT_THROW(CheckLimits({.min_coverage = 1.1}), std::invalid_argument);
  EXPECT_THROW(CheckLimits({.min_coverage = kNan}), std::invalid_argument);
}

TEST(AcceptanceTest, ALimitThatWouldRefuseNothingIsTheCallersMistake) {
  EXPECT_NO_THROW(CheckLimits(kLoosestLimits));
  const auto looser = [](auto limit, double factor) {
    AcceptanceLimits limits = kLoosestLimits;
    limits.*limit *= factor;
    return limits;
  };
  for (const auto limit :
       {&AcceptanceLimits::shift_tolerance_m, &AcceptanceLimits::rotation_tolerance_rad,
        &AcceptanceLimits::max_hole_m, &AcceptanceLimits::max_residual_p95_m,
        &AcceptanceLimits::max_lost_s, &AcceptanceLimits::max_breathing_m}) {
    EXPECT_NO_THROW(CheckLimits(looser(limit, 0.999)));
    EXPECT_THROW(CheckLimits(looser(limit, 1.001)), std::invalid_argument);
  }
  EXPECT_THROW(CheckLimits(looser(&AcceptanceLimits::min_coverage, 0.999)), std::invalid_argument);
}

TEST(AcceptanceTest, EveryVerdictHasItsName) {
  EXPECT_EQ(Name(Verdict::kInTolerance), "in_tolerance");
  EXPECT_EQ(Name(Verdict::kUnsure), "unsure");
  EXPECT_EQ(Name(Verdict::kMove), "move");
  EXPECT_EQ(Name(Verdict::kNoAnswer), "no_answer");
}

TEST(JudgeNumber, DecidesAtItsBoundariesAndNotWithoutWhatItNeeds) {
  using enum NumberJudgement;
  EXPECT_EQ(JudgeNumber(2.0, 1.0, 3.0), kWithin) << "the limit itself is within";
  EXPECT_EQ(JudgeNumber(-2.0, 1.0, 3.0), kWithin);
  EXPECT_EQ(JudgeNumber(2.0, 1.0001, 3.0), kUnsure);
  EXPECT_EQ(JudgeNumber(-3.0, 0.5, 3.0), kUnsure);
  EXPECT_EQ(JudgeNumber(3.0001, 0.5, 3.0), kOutside);
  EXPECT_EQ(JudgeNumber(-3.0001, 0.5, 3.0), kOutside);
  EXPECT_EQ(JudgeNumber(3.0001, std::nullopt, 3.0), kOutside);
  EXPECT_EQ(JudgeNumber(0.0, std::nullopt, 3.0), kUnjudged);
  EXPECT_EQ(JudgeNumber(0.0, kNan, 3.0), kUnjudged);
  EXPECT_EQ(JudgeNumber(0.0, 0.0, 3.0), kUnjudged) << "nobody stated it";
  EXPECT_EQ(JudgeNumber(std::nullopt, 1.0, 3.0), kUnjudged);
  EXPECT_EQ(JudgeNumber(kNan, 1.0, 3.0), kUnjudged);
  EXPECT_EQ(JudgeNumber(0.0, 1.0, kNan), kUnjudged);
}

TEST(AcceptanceTest, EachNumberIsJudgedOnceAlsoWithoutAnAnswer) {
  Evidence evidence = GoodEvidence();
  evidence.numbers[0]->value = -2.95;
  evidence.numbers[2].reset();
  evidence.numbers[5]->value = 1.1;
  const NumberJudgements expected = {NumberJudgement::kUnsure,   NumberJudgement::kWithin,
                                     NumberJudgement::kUnjudged, NumberJudgement::kWithin,
                                     NumberJudgement::kWithin,   NumberJudgement::kOutside};
  EXPECT_EQ(Decide(evidence, {}).numbers, expected);
  evidence.coverage = 0.1;
  EXPECT_EQ(Decide(evidence, {}).verdict, Verdict::kNoAnswer);
  EXPECT_EQ(Decide(evidence, {}).numbers, expected);
}

}  // namespace
}  // namespace plumb
