// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/text_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "daemon/result/result_folder.hpp"
#include "tests/support/result_with.hpp"
#include "words/direction.hpp"
#include "words/result.hpp"
#include "words/text_report.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

Comparison SomeComparison() {
  Comparison comparison;
  comparison.verdict = Verdict::kMove;
  Correction correction;
  correction.value = {.vertical_mm = 6.25,
                      .longitudinal_mm = 0.01,
                      .lateral_mm = std::nullopt,
                      .pitch_deg = 0.5,
                      .roll_deg = 0.9,
                      .yaw_deg = 0.1};
  correction.u95 = {.vertical_mm = 0.4,
                    .longitudinal_mm = 0.3,
                    .lateral_mm = std::nullopt,
                    .pitch_deg = 0.2,
                    .roll_deg = 0.2,
                    .yaw_deg = std::numeric_limits<double>::quiet_NaN()};
  correction.words[0] = say::direction::Up();
  correction.words[3] = say::direction::HeadUp();
  correction.words[4] = say::direction::PatientRightDown();
  correction.words[5] = say::direction::HeadToPatientLeft();
  correction.isocentre_m = {0.1, 0.2, 0.3};
  comparison.correction = correction;
  comparison.judgements = testing::JudgementsOf(Stored(comparison));
  return comparison;
}

TEST(TextReportTest, KeepsItsColumns) {
  EXPECT_THAT(
      ComparisonText(Stored(SomeComparison()), EnglishCatalogue()),
      AllOf(
          StartsWith("MOVE\n"), HasSubstr("(0.100, 0.200, 0.300) m of the reference marker"),
          HasSubstr("                     value        95 %   tolerance\n"),
          HasSubstr("  Vertical            +6.2 mm    ±  0.4       3 mm   outside tolerance  up\n"),
          HasSubstr("  Longitudinal        +0.0 mm    ±  0.3       3 mm   in tolerance       no "
                    "change\n"),
          HasSubstr("  Lateral          refused: couch-fixed markers show posture only\n"),
          HasSubstr("  Pitch              +0.50 deg   ± 0.20       1 deg  in tolerance       "
                    "head up\n"),
          HasSubstr("  Roll               +0.90 deg   ± 0.20       1 deg  inconclusive       "
                    "patient right side down\n"),
          HasSubstr("  Yaw                +0.10 deg   ±    ?       1 deg  not known          "
                    "head to patient left\n"),
          HasSubstr("T_iec_reference is not set"), HasSubstr("  markers          no alignment\n")));
}

// A plan may have no isocentre, and that of a planning CT is the origin of the CT's axes.
TEST(TextReportTest, NamesThePointAboutWhichTheNumbersAre) {
  Comparison comparison = SomeComparison();
  comparison.motion.emplace().centroid_m = comparison.correction->isocentre_m;
  EXPECT_THAT(ComparisonText(Stored(comparison), EnglishCatalogue()),
              HasSubstr("apply, about the middle of the region (0.100, 0.200, 0.300) m"));
  comparison.planning.emplace();
  EXPECT_THAT(ComparisonText(Stored(comparison), EnglishCatalogue()),
              HasSubstr("apply, at the isocentre\n"));
}

// Only MOVE asks for moves, and without an answer there is nothing to act on.
TEST(TextReportTest, TheTableSaysWhatTheVerdictAllows) {
  Comparison comparison = SomeComparison();
  comparison.verdict = Verdict::kNoAnswer;
  comparison.reasons = {say::text_report::NoAlignment()};
  for (const Catalogue* language : Catalogues()) {
    const std::string text = ComparisonText(Stored(comparison), *language);
    EXPECT_THAT(text, StartsWith(Text(say::text_report::NoAnswer(), *language) + "\n  " +
                                 Text(say::text_report::NoAlignment(), *language) + "\n"));
    for (const Message& advice :
         {say::text_report::Correction(say::text_report::AtIsocentre(0.1, 0.2, 0.3)),
          say::text_report::Measured(say::text_report::AtIsocentre(0.1, 0.2, 0.3)),
          say::text_report::Tolerance(), say::result::Outside(), say::result::Within(),
          say::direction::HeadUp(), say::direction::HeadToPatientLeft()})
      EXPECT_THAT(text, Not(HasSubstr(Text(advice, *language)))) << language->code;
    EXPECT_THAT(text, Not(HasSubstr("±"))) << language->code;
  }
  EXPECT_EQ(PictureSubtitle(comparison), "NO ANSWER: no alignment");

  comparison.verdict = Verdict::kUnsure;
  comparison.correction->value.vertical_mm = 2.8;
  comparison.judgements = testing::JudgementsOf(Stored(comparison));
  const std::string unsure = ComparisonText(Stored(comparison), EnglishCatalogue());
  EXPECT_THAT(unsure, AllOf(HasSubstr("Measured, at the isocentre"), HasSubstr("scan again\n"),
                            HasSubstr("no move needed\n"), Not(HasSubstr("to apply")),
                            Not(HasSubstr("head up"))));
  EXPECT_THAT(PictureSubtitle(comparison), HasSubstr("; measured vertical +2.8"));
}

TEST(TextReportTest, IsWrittenInEveryLanguage) {
  for (const Catalogue* language : Catalogues()) {
    const std::string text = ComparisonText(Stored(SomeComparison()), *language);
    for (const Message& said :
         {say::text_report::Move(), say::text_report::Refused(), say::result::NotSurely(),
          say::text_report::Tolerance(), say::result::AxisRoll(), say::direction::Up(),
          say::text_report::RoomUnknown(), say::text_report::NoAlignment(), say::result::Notice()})
      EXPECT_THAT(text, HasSubstr(Text(said, *language))) << language->code;
    EXPECT_THAT(text, HasSubstr(std::string("+6") + language->decimal + "2")) << language->code;
    if (language->decimal != '.') {
      EXPECT_THAT(text, Not(HasSubstr("+6.2"))) << language->code;
    }
  }
}

}  // namespace
}  // namespace plumb
