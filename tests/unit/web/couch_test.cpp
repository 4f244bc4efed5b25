// SPDX-License-Identifier: Apache-2.0
// The profile of the couch: who signs it, and how the six numbers are then counted. The numbers of
// a couch are written here by hand.
#include <gmock/gmock.h>

#include "tests/unit/web/web_fixture.hpp"
#include "web/model/couch.hpp"

namespace plumb::test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// Vertical -33.9 mm, lateral within tolerance, pitch outside it.
ResultSummary Move() {
  ResultSummary result;
  result.verdict = Verdict::kMove;
  result.correction = {.vertical_mm = -33.9,
                       .longitudinal_mm = 0.0,
                       .lateral_mm = 1.5,
                       .pitch_deg = 2.4,
                       .roll_deg = 0.3,
                       .yaw_deg = -1.8};
  result.u95 = {.vertical_mm = 0.7,
                .longitudinal_mm = 0.6,
                .lateral_mm = 0.5,
                .pitch_deg = 0.2,
                .roll_deg = 0.1,
                .yaw_deg = 0.1};
  result.tolerance = {.shift_mm = 2.0, .rotation_deg = 1.0};
  constexpr auto kIn = NumberJudgement::kWithin, kOut = NumberJudgement::kOutside;
  result.judgements = {kOut, kIn, kIn, kOut, kIn, kOut};
  result.words[0] = Message::Verbatim("down");
  result.words[3] = Message::Verbatim("head up");
  result.words[4] = Message::Verbatim("left side down");
  return result;
}

CouchProfile Reversed() {
  return {.version = 1,
          .name = "Couch 2",
          .num_axes = 4,
          .is_in_cm = true,
          .reverses = {true, false, false, false, false, true}};
}

TEST(CouchTest, WithoutAProfileTheNumbersAreThoseOfTheResult) {
  const std::vector<CouchRow> rows = CouchRows(Move(), {});
  ASSERT_EQ(rows.size(), 6U);
  for (const CouchRow& row : rows) {
    EXPECT_EQ(row.value, row.judged.value);
    EXPECT_EQ(row.tolerance, row.judged.tolerance);
    EXPECT_TRUE(row.axis.moves);
    EXPECT_FALSE(row.is_hidden);
  }
  EXPECT_EQ(UnitBehind(rows[0].axis), " mm");
  EXPECT_EQ(UnitBehind(rows[3].axis), "\u00b0");
  EXPECT_EQ(rows[3].way.English(), "head up");
  EXPECT_THAT(CouchNotes({}), IsEmpty());
}

TEST(CouchTest, ACouchCountsInItsUnitAndItsWayAndTheVerdictStays) {
  const std::vector<CouchRow> rows = CouchRows(Move(), Reversed());
  EXPECT_DOUBLE_EQ(*rows[0].value, 3.39);  // cm, and growing downward
  EXPECT_DOUBLE_EQ(*rows[0].u95, 0.07);
  EXPECT_DOUBLE_EQ(rows[0].tolerance, 0.2);
  EXPECT_EQ(UnitBehind(rows[0].axis), " cm");
  EXPECT_EQ(rows[0].way.English(), "down") << "the body's way has no sign";
  EXPECT_EQ(rows[0].judged.judgement, NumberJudgement::kOutside);
  EXPECT_DOUBLE_EQ(*rows[2].value, 0.15);
  EXPECT_DOUBLE_EQ(*rows[5].value, 1.8) << "degrees stay degrees";
  EXPECT_DOUBLE_EQ(rows[5].tolerance, 1.0);
}

TEST(CouchTest, WhatTheCouchCannotDoIsSaidAndNeverHiddenOutsideTolerance) {
  CouchProfile couch = Reversed();
  std::vector<CouchRow> rows = CouchRows(Move(), couch);
  EXPECT_FALSE(rows[3].axis.moves);
  EXPECT_FALSE(rows[4].axis.moves);
  EXPECT_TRUE(rows[5].axis.moves);
  EXPECT_EQ(rows[3].way.English(), "not by the couch: move the patient");
  EXPECT_FALSE(rows[4].is_hidden);
  couch.hides_rest = true;
  rows = CouchRows(Move(), couch);
  EXPECT_FALSE(rows[3].is_hidden) << "outside tolerance";
  EXPECT_TRUE(rows[4].is_hidden);
  EXPECT_FALSE(rows[2].is_hidden) << "the couch can";
  couch.num_axes = 3;
  rows = CouchRows(Move(), couch);
  EXPECT_FALSE(rows[5].axis.moves);
  EXPECT_FALSE(rows[5].is_hidden);
  EXPECT_THAT(CouchApply(couch).English(), HasSubstr("the 3 numbers"));
  ResultSummary unsure = Move();
  unsure.judgements[4] = NumberJudgement::kUnsure;
  EXPECT_FALSE(CouchRows(unsure, couch)[4].is_hidden) << "inconclusive";
}

TEST(CouchTest, ReadingsWithoutValuesBelowZeroBeginAtZeroAgain) {
  CouchProfile couch = Reversed();
  EXPECT_EQ(CouchAxisOf(couch, 0).period, std::nullopt);
  couch.wraps = true;
  EXPECT_EQ(CouchAxisOf(couch, 0).period, 1000.0) << "cm";
  EXPECT_EQ(CouchAxisOf(couch, 5).period, 360.0);
  EXPECT_THAT(CouchNotes(couch)[3].English(), HasSubstr("995 cm (9950 mm) stands for"));
  EXPECT_DOUBLE_EQ(*CouchRows(Move(), couch)[5].value, 1.8) << "a correction has its sign";
  couch.is_in_cm = false;
  EXPECT_EQ(CouchAxisOf(couch, 0).period, 10000.0) << "mm";
}

TEST(CouchTest, InAnUnknownRoomNothingIsOfTheCouch) {
  ResultSummary unknown = Move();
  for (std::size_t i = 0; i < unknown.axes.size(); ++i) unknown.axes[i] = AxisName(i);
  EXPECT_TRUE(RunsAlongCouch(unknown)) << "as the store names them in a known room";
  unknown.axes[1] = Message::Verbatim("Along marker X");
  for (const CouchRow& row : CouchRows(unknown, Reversed())) {
    EXPECT_EQ(row.value, row.judged.value);
    EXPECT_TRUE(row.axis.moves);
  }
}

class CouchAtTheWire : public WebTest {
 protected:
  void SetUp() override {
    Start();
    SetUpAccounts();
  }
  static nlohmann::json Wanted(int version) {
    return {{"version", version},
            {"name", "Couch 2"},
            {"num_axes", 4},
            {"is_in_cm", true},
            {"hides_rest", true},
            {"reverses_vertical", true},
            {"reverses_longitudinal", false},
            {"reverses_lateral", false},
            {"reverses_pitch", false},
            {"reverses_roll", false},
            {"reverses_yaw", true},
            {"password", kPassword}};
  }
};

TEST_F(CouchAtTheWire, APhysicistOrAnEngineerSignsWhatWasRead) {
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist"),
             engineer = LoggedIn("engineer");
  const auto couch = [&] { return technician.Get("/api/v1/status").json()["couch"]; };
  EXPECT_EQ(couch()["version"], 0);
  EXPECT_THAT(couch()["notes"], IsEmpty());
  EXPECT_EQ(technician.Post("/api/v1/couch", Wanted(0)).status, 403);
  nlohmann::json wrong = Wanted(0);
  wrong["password"] = "not this one";
  EXPECT_EQ(physicist.Post("/api/v1/couch", wrong).status, 403);
  wrong = Wanted(0);
  wrong["num_axes"] = 5;
  EXPECT_EQ(physicist.Post("/api/v1/couch", wrong).status, 400);
  EXPECT_EQ(couch()["version"], 0);
  EXPECT_EQ(physicist.Post("/api/v1/couch", Wanted(0)).status, 201);
  EXPECT_EQ(couch()["version"], 1);
  EXPECT_EQ(couch()["signed_by"], "physicist");
  EXPECT_EQ(couch()["axes"]["vertical"]["factor"], -0.1);
  EXPECT_EQ(couch()["axes"]["vertical"]["unit"], "cm");
  EXPECT_EQ(couch()["axes"]["pitch"]["moves"], false);
  EXPECT_EQ(couch()["axes"]["yaw"]["moves"], true);
  EXPECT_EQ(couch()["notes"].size(), 4U);
  EXPECT_EQ(service_.audit.back().action, "couch.set");
  EXPECT_EQ(engineer.Post("/api/v1/couch", Wanted(0)).status, 409) << "not what is in force";
  EXPECT_EQ(engineer.Post("/api/v1/couch", Wanted(1)).status, 201);
}

TEST_F(CouchAtTheWire, ThePageWithoutScriptCountsAsTheCouchDoes) {
  loop_->Do([&] {
    Scan scan;
    scan.id = "s1";
    scan.outcome = ScanOutcome::kDone;
    scan.started_at = scan.finished_at.emplace(WallClock::now());
    scan.age_s = 1.0;
    scan.result = Move();
    service_.scans.push_back(scan);
    service_.status.last_result = scan;
  });
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  EXPECT_THAT(technician.Get("/result").body,
              AllOf(HasSubstr("33.9 mm"), HasSubstr("Roll"), Not(HasSubstr("couch-notes"))));
  EXPECT_EQ(physicist.Post("/api/v1/couch", Wanted(0)).status, 201);
  EXPECT_THAT(technician.Get("/result").body,
              AllOf(HasSubstr("+3.39 cm"), HasSubstr("\u00b10.2 cm"), HasSubstr("MOVE"),
                    HasSubstr("not by the couch: move the patient"), HasSubstr("Couch 2"),
                    Not(HasSubstr("33.9")), Not(HasSubstr(">Roll<"))));
}

}  // namespace
}  // namespace plumb::test
