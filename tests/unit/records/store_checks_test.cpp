// SPDX-License-Identifier: Apache-2.0
// The daily checks of the markers and their baseline.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/database/schema.hpp"
#include "daemon/records/check_json.hpp"
#include "tests/unit/records/store_fixture.hpp"

namespace plumb {
namespace {

using testing::kAnna;
using testing::kBert;
using ::testing::SizeIs;
using testing::StoreTest;

/// What a check that ended in `status` stores after seeing the markers 1 to n in a row.
TakenCheck CheckWith(int n, MarkerCheckStatus status) {
  MarkerBaseline seen{{}, {.dictionary = "DICT_6X6_250", .length_m = 0.104}};
  for (int id = 1; id <= n; ++id) {
    SceneMarker marker{.corners = CornersInMarkerFrame(0.104), .num_views = 9, .sigma_m = 0.0005};
    for (Eigen::Vector3d& corner : marker.corners) corner.x() += 0.3 * id;
    seen.markers[id] = marker;
  }
  return {.check = {.status = status,
                    .items = {{"moved", 1.25, 5.0, "mm", true, Message::Verbatim("marker 2")}},
                    .reasons = {Message::Verbatim("because")}},
          .seen = std::move(seen)};
}

TEST_F(StoreTest, ACheckWithAStampOfTheFutureCountsForNoDay) {
  const auto store = Open();
  Database(database(), Database::Access::kReadWrite)
      .Execute(
          "INSERT INTO checks (time, user, sensor_serial, status, json) VALUES (9000000000000000, "
          "'anna', 'S1', 'passed', '{}')");
  EXPECT_EQ(store->checks.StateSince(WallClock::now()), DailyCheck::kOverdue);
}

TEST_F(StoreTest, TheNewestCheckOfTheDayAndSensorDecides) {
  const auto store = Open();
  const auto since = WallClock::now() - std::chrono::seconds(1);
  const auto add = [&](const char* serial, MarkerCheckStatus status) {
    store->checks.Add(kAnna, serial, CheckWith(4, status));
  };
  const auto state = [&](const std::string& serial) {
    return store->checks.StateSince(since, serial);
  };
  add("S1", MarkerCheckStatus::kFailed);
  EXPECT_EQ(state("S1"), DailyCheck::kFailed);
  EXPECT_EQ(state("S2"), DailyCheck::kOverdue) << "a failure of another unit";
  add("S1", MarkerCheckStatus::kPassed);
  EXPECT_EQ(state("S1"), DailyCheck::kPassed) << "failed, then passed";
  add("S2", MarkerCheckStatus::kFailed);
  EXPECT_EQ(state("S1"), DailyCheck::kPassed) << "another unit failed";
  EXPECT_EQ(state(""), DailyCheck::kFailed) << "any unit";
  add("S1", MarkerCheckStatus::kFailed);
  EXPECT_EQ(state("S1"), DailyCheck::kFailed) << "passed, then failed";
  add("S1", MarkerCheckStatus::kNoBaseline);
  EXPECT_EQ(state("S1"), DailyCheck::kFailed) << "it says neither";
  add("S1", MarkerCheckStatus::kPassed);
  add("", MarkerCheckStatus::kFailed);
  EXPECT_EQ(state("S1"), DailyCheck::kFailed) << "it may have been this unit";
}

TEST_F(StoreTest, ACheckOfYesterdayDecidesNothingToday) {
  const auto store = Open();
  const auto at = [&](std::chrono::hours ago, const char* status) {
    const auto time = std::chrono::duration_cast<std::chrono::microseconds>(
        (WallClock::now() - ago).time_since_epoch());
    Database(database(), Database::Access::kReadWrite)
        .Execute("INSERT INTO checks (time, user, sensor_serial, status, json) VALUES (" +
                 std::to_string(time.count()) + ", 'anna', 'S1', '" + status + "', '{}')");
  };
  const auto midnight = WallClock::now() - std::chrono::hours(3);
  const auto today = [&] { return store->checks.StateSince(midnight, "S1"); };
  at(std::chrono::hours(4), "failed");
  EXPECT_EQ(today(), DailyCheck::kOverdue) << "a failure of yesterday";
  at(std::chrono::hours(2), "passed");
  EXPECT_EQ(today(), DailyCheck::kPassed);
  at(std::chrono::hours(4), "failed");  // the clock has been set back since
  EXPECT_EQ(today(), DailyCheck::kOverdue) << "what came last has not passed";
}

TEST_F(StoreTest, ACheckOfTheSameDaySensorAndBaselineConfirmsAScanFromBeforeIt) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "P-1", "");
  const auto scan = [&](const char* serial) {
    const std::string id = store->scans.Begin({.patient_id = patient,
                                               .reference_id = "",
                                               .sensor_serial = serial,
                                               .reason = "",
                                               .daily_check = DailyCheck::kOverdue});
    store->scans.Finish(
        id, {.outcome = ScanOutcome::kFailed, .failure = Message::Verbatim("of this test")});
    return id;
  };
  const std::string early = scan("S1");
  const std::string first =
      store->checks.Add(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kNoBaseline));
  store->checks.SetBaseline(kBert, first, "the markers are in place");
  store->checks.Add(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kPassed));
  EXPECT_FALSE(store->checks.ConfirmsScan(early)) << "the baseline is younger than the scan";

  const std::string good = scan("S1"), other = scan("S2"), unnamed = scan("");
  EXPECT_FALSE(store->checks.ConfirmsScan(good)) << "the check that passed is older";
  store->checks.Add(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kPassed));
  EXPECT_TRUE(store->checks.ConfirmsScan(good));
  EXPECT_FALSE(store->checks.ConfirmsScan(other)) << "another unit";
  EXPECT_FALSE(store->checks.ConfirmsScan(unnamed));
  EXPECT_FALSE(store->checks.ConfirmsScan("none"));

  const std::string doubtful = scan("S1");
  store->checks.Add(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kFailed));
  store->checks.Add(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kPassed));
  EXPECT_FALSE(store->checks.ConfirmsScan(doubtful)) << "a check failed in between";
  const std::string unsure = scan("S1");
  store->checks.Add(kAnna, "", CheckWith(4, MarkerCheckStatus::kFailed));
  store->checks.Add(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kPassed));
  EXPECT_FALSE(store->checks.ConfirmsScan(unsure)) << "a check of an unnamed unit failed";

  const std::string yesterday = scan("S1");
  store->checks.Add(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kPassed));
  EXPECT_TRUE(store->checks.ConfirmsScan(yesterday)) << "still of today";
  Database(database(), Database::Access::kReadWrite)
      .Execute(
          "UPDATE check_baselines SET set_at = 0; UPDATE scans SET started_at = started_at - "
          "86400000000, finished_at = finished_at - 86400000000 WHERE id = " +
          yesterday);
  EXPECT_FALSE(store->checks.ConfirmsScan(yesterday)) << "a check of another day";
}

TEST_F(StoreTest, TheFirstCheckAfterAScanRefutesItIfItFailed) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "P-1", "");
  const auto scan = [&](const char* serial) {
    return store->scans.Begin({.patient_id = patient,
                               .reference_id = "",
                               .sensor_serial = serial,
                               .reason = "",
                               .daily_check = DailyCheck::kPassed});
  };
  const auto check = [&](const char* serial, MarkerCheckStatus status) {
    store->checks.Add(kAnna, serial, CheckWith(4, status));
  };
  check("S1", MarkerCheckStatus::kFailed);
  const std::string good = scan("S1");
  EXPECT_FALSE(store->checks.RefutesScan(good)) << "the check that failed is older";
  check("S2", MarkerCheckStatus::kFailed);
  check("S1", MarkerCheckStatus::kNoBaseline);
  EXPECT_FALSE(store->checks.RefutesScan(good)) << "another unit, and a check that judges nothing";
  check("S1", MarkerCheckStatus::kPassed);
  check("S1", MarkerCheckStatus::kFailed);
  EXPECT_FALSE(store->checks.RefutesScan(good)) << "a check passed before";

  const std::string bad = scan("S1"), unsure = scan("S3");
  check("", MarkerCheckStatus::kFailed);
  EXPECT_TRUE(store->checks.RefutesScan(unsure)) << "of an unnamed unit";
  check("S1", MarkerCheckStatus::kPassed);
  EXPECT_TRUE(store->checks.RefutesScan(bad)) << "a later pass does not help";
  EXPECT_FALSE(store->checks.RefutesScan("none"));
}

TEST_F(StoreTest, KeepsDailyChecksAndTheBaselineOverARestart) {
  const auto before = WallClock::now() - std::chrono::seconds(1);
  {
    const auto store = Open();
    EXPECT_FALSE(store->checks.Baseline());
    EXPECT_FALSE(store->checks.BaselineMarkers());
    const std::string first =
        store->checks.Add(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kNoBaseline));
    EXPECT_EQ(store->checks.StateSince(before), DailyCheck::kOverdue) << "there is no baseline";
    store->checks.SetBaseline(kBert, first, "the markers are in place");
    EXPECT_EQ(store->audit.Find({0, 1, "check.baseline"}).at(0).detail.English(),
              "4 markers; reason: the markers are in place");
    store->checks.Add(kAnna, "S1", CheckWith(5, MarkerCheckStatus::kPassed));
  }
  const auto store = Open();
  const std::vector<CheckRecord> checks = store->checks.List(10);
  ASSERT_THAT(checks, SizeIs(2));
  EXPECT_EQ(checks[0].status, MarkerCheckStatus::kPassed);
  EXPECT_EQ(checks[0].user, "anna");
  EXPECT_EQ(checks[0].sensor_serial, "S1");
  EXPECT_EQ(checks[0].num_markers, 5U);
  ASSERT_THAT(checks[0].items, SizeIs(1));
  EXPECT_EQ(checks[0].items[0].value, 1.25);
  EXPECT_EQ(checks[0].items[0].note.English(), "marker 2");
  EXPECT_EQ(EnglishTexts(checks[1].reasons), std::vector<std::string>{"because"});
  EXPECT_EQ(store->checks.StateSince(before), DailyCheck::kPassed);
  EXPECT_EQ(store->checks.StateSince(WallClock::now() + std::chrono::hours(1)),
            DailyCheck::kOverdue);
  EXPECT_EQ(store->checks.StateSince(before, "S1"), DailyCheck::kPassed);
  EXPECT_EQ(store->checks.StateSince(before, "S2"), DailyCheck::kOverdue) << "of another unit";
  const auto baseline = store->checks.Baseline();
  ASSERT_TRUE(baseline);
  EXPECT_EQ(baseline->check_id, checks[1].id);
  EXPECT_EQ(baseline->set_by, "bert");
  EXPECT_EQ(baseline->num_markers, 4U);
  const auto markers = store->checks.BaselineMarkers();
  ASSERT_TRUE(markers);
  EXPECT_EQ(markers->room_markers.dictionary, "DICT_6X6_250");
  EXPECT_NEAR(markers->markers.at(3).corners[0].x(), 0.9 - 0.052, 1e-12);
  EXPECT_EQ(markers->markers.at(3).num_views, 9);
  std::vector<std::string> actions;
  for (const AuditEntry& entry : store->audit.Find({0, 10}))
    actions.push_back(entry.user + " " + entry.action + " " + entry.detail.English());
  EXPECT_THAT(actions, ::testing::IsSupersetOf(
                           {"anna check.done passed", "anna check.done no baseline",
                            "bert check.baseline 4 markers; reason: the markers are in place"}));
  store->checks.SetBaseline(kBert, checks[0].id, "the markers are in place");
  EXPECT_EQ(store->audit.Find({0, 1}).at(0).detail.English(),
            "5 markers; before: check 1 with 4 markers; reason: the markers are in place");
}

TEST_F(StoreTest, WhatAnotherBaselineChangesIsNamed) {
  const auto store = Open();
  const auto changes = [&](const TakenCheck& check) {
    std::vector<std::string> said;
    for (const Message& change : store->checks.ChangesBy(store->checks.Add(kAnna, "S1", check)))
      said.push_back(change.English());
    return said;
  };
  EXPECT_THAT(changes(CheckWith(5, MarkerCheckStatus::kNoBaseline)), ::testing::IsEmpty());
  store->checks.SetBaseline(
      kBert, store->checks.Add(kAnna, "S1", CheckWith(5, MarkerCheckStatus::kNoBaseline)), "first");
  EXPECT_THAT(changes(CheckWith(5, MarkerCheckStatus::kPassed)),
              ::testing::ElementsAre("every marker lies where it was, within 1 mm"));
  TakenCheck other = CheckWith(6, MarkerCheckStatus::kFailed);
  other.seen.markers.erase(5);
  for (Eigen::Vector3d& corner : other.seen.markers.at(2).corners) corner.y() += 0.03;
  EXPECT_THAT(changes(other), ::testing::ElementsAre("no longer part of the baseline: marker 5",
                                                     "new in the baseline: marker 6",
                                                     "marker 2 lies 30.0 mm from where it was"));
}

TEST_F(StoreTest, ABaselineNeedsACheckThatSawMarkers) {
  const auto store = Open();
  EXPECT_EQ(RefusalOf([&] { store->checks.SetBaseline(kAnna, "77", "the markers are in place"); }),
            ChangeResult::kNotFound);
  EXPECT_EQ(RefusalOf([&] { store->checks.SetBaseline(kAnna, "x", "the markers are in place"); }),
            ChangeResult::kNotFound);
  const std::string blind =
      store->checks.Add(kAnna, "S1", CheckWith(2, MarkerCheckStatus::kFailed));
  EXPECT_EQ(RefusalOf([&] { store->checks.SetBaseline(kBert, blind, "the markers are in place"); }),
            ChangeResult::kConflict);
  const std::string good =
      store->checks.Add(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kNoBaseline));
  EXPECT_EQ(RefusalOf([&] { store->checks.SetBaseline(kAnna, good, "the markers are in place"); }),
            ChangeResult::kRefused)
      << "not by the person who took it";
  EXPECT_FALSE(store->checks.Baseline());
}

TEST_F(StoreTest, ChecksAreNeverChanged) {
  (void)Open()->checks.Add(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kFailed));
  Database direct(database(), Database::Access::kReadWrite);
  EXPECT_THROW(direct.Execute("UPDATE checks SET status = 'passed'"), ConstraintBroken);
  EXPECT_THROW(direct.Execute("DELETE FROM checks"), ConstraintBroken);
}

}  // namespace
}  // namespace plumb
