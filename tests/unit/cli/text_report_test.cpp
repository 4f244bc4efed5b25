// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/text_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/result/result_folder.hpp"
#include "tests/support/result_with.hpp"
#include "words/direction.hpp"
#include "words/number.hpp"
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
                    .yaw_deg = 0.1};
  correction.words[0] = say::direction::Up();
  correction.isocentre_m = {0.1, 0.2, 0.3};
  comparison.correction = correction;
  comparison.judgements = testing::JudgementsOf(Stored(comparison));
  return comparison;
}

TEST(TextReportTest, KeepsItsColumns) {
  EXPECT_THAT(
      ComparisonText(Stored(SomeComparison()), EnglishCatalogue()),
      AllOf(StartsWith("MOVE\n"), HasSubstr("(0.100, 0.200, 0.300) m of the reference marker"),
            HasSubstr("                     value        95 %   tolerance\n"),
            HasSubstr("  vertical            +6.2 mm    ±  0.4       3 mm   MOVE    up\n"),
            HasSubstr("  longitudinal        +0.0 mm    ±  0.3       3 mm   ok      \n"),
            HasSubstr("  lateral          refused: couch-fixed markers show posture only\n"),
            HasSubstr("  pitch              +0.50 deg   ± 0.20       1 deg  ok      \n"),
            HasSubstr("  roll               +0.90 deg   ± 0.20       1 deg  unsure  \n"),
            HasSubstr("T_iec_reference is not set"),
            HasSubstr("  markers          no alignment\n")));
}

TEST(TextReportTest, IsWrittenInEveryLanguage) {
  for (const Catalogue* language : Catalogues()) {
    const std::string text = ComparisonText(Stored(SomeComparison()), *language);
    for (const Message& said :
         {say::text_report::Move(), say::text_report::Refused(), say::text_report::RowUnsure(),
          say::text_report::Tolerance(), say::number::Roll(), say::direction::Up(),
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
