// SPDX-License-Identifier: Apache-2.0
#include "daemon/messages_out/occasions.hpp"

#include <gtest/gtest.h>

#include "words/upkeep.hpp"

namespace plumb {
namespace {

using std::chrono::hours;
using std::chrono::minutes;

const WallClock::time_point kNow = WallClock::time_point(hours(500'000));

std::tm At(int weekday, int hour, int minute = 0) {
  std::tm local{};
  local.tm_wday = weekday;
  local.tm_hour = hour;
  local.tm_min = minute;
  return local;
}

/// A unit about which there is nothing to tell.
Status WellStatus() {
  Status status;
  status.state = ApplianceState::kReady;
  status.daily_check = DailyCheck::kPassed;
  return status;
}

std::vector<Occasion> Now(const Status& status, const OccasionRules& rules = {}, double up_s = 0.0,
                          const std::tm& local = At(1, 12)) {
  return OccasionsOf(status, rules, up_s, kNow, local);
}

TEST(OccasionsTest, AWellUnitTellsNothing) { EXPECT_TRUE(Now(WellStatus()).empty()); }

TEST(OccasionsTest, ACheckIsOverdueFromTheTimeOnWorkdaysUnlessItFailed) {
  Status status = WellStatus();
  status.daily_check = DailyCheck::kOverdue;
  const OccasionRules rules{.check_due_min = 8 * 60 + 30};
  EXPECT_TRUE(Now(status, rules, 0, At(1, 8, 29)).empty());
  ASSERT_EQ(Now(status, rules, 0, At(1, 8, 30)).size(), 1U);
  EXPECT_EQ(Now(status, rules, 0, At(1, 8, 30))[0].kind, OccasionKind::kDailyCheck);
  EXPECT_TRUE(Now(status, rules, 0, At(0, 12)).empty()) << "a Sunday";
  EXPECT_TRUE(Now(status, rules, 0, At(6, 12)).empty()) << "a Saturday";
  EXPECT_EQ(Now(status, {.check_on_weekends = true}, 0, At(0, 12)).size(), 1U);
  status.daily_check = DailyCheck::kFailed;
  EXPECT_EQ(Now(status, rules, 0, At(0, 3)).size(), 1U) << "whatever the time";
}

TEST(OccasionsTest, ABackupIsOverdueAfterTwoIntervals) {
  const OccasionRules rules{.backup_hours = 24, .makes_backups = true};
  Status status = WellStatus();
  EXPECT_TRUE(Now(status, rules, 47 * 3600.0).empty()) << "it has had no time to make one";
  EXPECT_EQ(Now(status, rules, 49 * 3600.0).size(), 1U);
  EXPECT_TRUE(Now(status, {.makes_backups = false}, 49 * 3600.0).empty());
  status.storage.backup_made_at = kNow - hours(47);
  EXPECT_TRUE(Now(status, rules, 49 * 3600.0).empty());
  status.storage.backup_made_at = kNow - hours(49);
  ASSERT_EQ(Now(status, rules).size(), 1U);
  EXPECT_EQ(Now(status, rules)[0].parts, std::set<std::string>{"overdue"});
  status.storage.warnings = {say::upkeep::BackupFailed(Message::Verbatim("patient Jane"))};
  ASSERT_EQ(Now(status).size(), 1U);
  EXPECT_EQ(Now(status)[0].parts, std::set<std::string>{"failed"});
  status.storage.warnings = {say::upkeep::BackupNotRehearsed(Message::Verbatim("no room"))};
  EXPECT_EQ(Now(status, rules)[0].parts, std::set<std::string>{"overdue"});
  status.storage.backup_made_at = kNow;
  ASSERT_EQ(Now(status, rules).size(), 1U);
  EXPECT_EQ(Now(status, rules)[0].text, say::messages::BackupNotRehearsed());
}

TEST(OccasionsTest, EachKindNamesNoPatientNoFileAndNoReason) {
  Status status = WellStatus();
  status.storage.warnings = {
      say::upkeep::NearlyFull(91), say::upkeep::BackupFailed(Message::Verbatim("SECRET")),
      say::upkeep::LogUnchecked(Message::Verbatim("SECRET")), say::upkeep::ScansUnusable(3)};
  status.waiting = {{.reference_id = "SECRET",
                     .patient_id = "SECRET",
                     .patient_code = "SECRET",
                     .planned_by = {}}};
  status.state = ApplianceState::kFault;
  status.fault_kind = FaultKind::kStorage;
  status.fault = Message::Verbatim("SECRET");
  std::set<OccasionKind> kinds;
  for (const Occasion& occasion : Now(status)) {
    kinds.insert(occasion.kind);
    for (const Catalogue* language : Catalogues())
      EXPECT_EQ(Text(occasion.text, *language).find("SECRET"), std::string::npos);
  }
  EXPECT_EQ(kinds, (std::set{OccasionKind::kDisk, OccasionKind::kBackup, OccasionKind::kApproval,
                             OccasionKind::kIntegrity, OccasionKind::kStorage}));
}

class OccasionMemoryTest : public ::testing::Test {
 protected:
  /// How often it is told now, and whether as a repetition.
  std::string Tell(std::set<std::string> parts) {
    std::vector<Occasion> present;
    if (!parts.empty()) present.push_back({OccasionKind::kApproval, std::move(parts), {}});
    std::string told;
    for (const auto& one : memory_.ToTell(present, now_)) told += one.is_repeated ? "again" : "new";
    return told;
  }

  OccasionMemory memory_;
  OccasionMemory::Time now_{hours(1000)};
};

TEST_F(OccasionMemoryTest, AnEventIsToldOnceAndThenOnceADay) {
  EXPECT_EQ(Tell({"a"}), "new");
  now_ += minutes(1);
  EXPECT_EQ(Tell({"a"}), "");
  now_ += hours(23);
  EXPECT_EQ(Tell({"a"}), "");
  now_ += hours(1);
  EXPECT_EQ(Tell({"a"}), "again");
  now_ += hours(24);
  EXPECT_EQ(Tell({"a"}), "again");
}

TEST_F(OccasionMemoryTest, OneMoreIsANewEventAndOneLessIsNot) {
  EXPECT_EQ(Tell({"a", "b"}), "new");
  now_ += hours(2);
  EXPECT_EQ(Tell({"b"}), "");
  EXPECT_EQ(Tell({"b", "c"}), "new");
}

TEST_F(OccasionMemoryTest, WhatComesAndGoesIsToldOnceAnHour) {
  EXPECT_EQ(Tell({"a"}), "new");
  for (int i = 0; i < 59; ++i) {
    now_ += minutes(1);
    EXPECT_EQ(Tell(i % 2 == 0 ? std::set<std::string>{} : std::set<std::string>{"a"}), "");
  }
  now_ += minutes(1);
  EXPECT_EQ(Tell({"a"}), "new");
}

}  // namespace
}  // namespace plumb
