// SPDX-License-Identifier: Apache-2.0
#include "web/api/look_back.hpp"

#include <gtest/gtest.h>

#include "tests/support/fake_appliance.hpp"

namespace plumb::test {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

class LookBackTest : public testing::Test {
 protected:
  void Add(WallClock::time_point time, const std::string& user, const std::string& action) {
    service_.audit.push_back({.number = static_cast<std::int64_t>(service_.audit.size()) + 1,
                              .time = time,
                              .user = user,
                              .address = "10.0.0.5",
                              .action = action,
                              .subject = {},
                              .detail = {}});
  }

  const WallClock::time_point begun_ = WallClock::now();
  FakeAppliance service_;
};

TEST_F(LookBackTest, TellsTheLogInBeforeThisOneAndWhatFailedSince) {
  Add(begun_ - minutes(90), "anna", "login.failed");  // before the last log-in, so already reported
  Add(begun_ - minutes(80), "anna", "login");
  Add(begun_ - minutes(70), "anna", "login.failed");
  Add(begun_ - minutes(60), "bob", "login.failed");
  Add(begun_ - minutes(50), "bob", "login");
  Add(begun_ - seconds(1), "anna", "login.failed");
  Add(begun_, "anna", "login");  // this one
  const web::LoginHistory history = web::LoginsBefore(service_, "anna", begun_);
  ASSERT_TRUE(history.last);
  EXPECT_EQ(history.last->time, begun_ - minutes(80));
  EXPECT_EQ(history.last->address, "10.0.0.5");
  EXPECT_EQ(history.failed, 2);
}

TEST_F(LookBackTest, TellsWhatWasChangedAboutTheAccountSinceTheLogInBefore) {
  const auto changed = [&](WallClock::time_point time, const char* by, const char* whose,
                           const char* action) {
    Add(time, by, action);
    service_.audit.back().subject = whose;
  };
  changed(begun_ - minutes(90), "eve", "anna", "user.change");  // already reported
  Add(begun_ - minutes(80), "anna", "login");
  changed(begun_ - minutes(70), "eve", "anna", "user.change");
  changed(begun_ - minutes(65), "eve", "bob", "user.change");
  changed(begun_ - minutes(60), "anna", "anna", "user.second_factor_off");
  Add(begun_, "anna", "login");  // this one
  const web::LoginHistory history = web::LoginsBefore(service_, "anna", begun_);
  ASSERT_EQ(history.changes.size(), 2U);
  EXPECT_EQ(history.changes[0].action, "user.second_factor_off");
  EXPECT_EQ(history.changes[1].user, "eve");
  EXPECT_EQ(history.changes[1].time, begun_ - minutes(70));
}

TEST_F(LookBackTest, OneThatIsAsOldAsTheSessionIsItsOwn) {
  Add(begun_ - seconds(1), "anna", "login");
  Add(begun_, "anna", "login");
  const auto before = [&](WallClock::time_point time) {
    return web::LoginsBefore(service_, "anna", time).last;
  };
  ASSERT_TRUE(before(begun_));
  EXPECT_EQ(before(begun_)->time, begun_ - seconds(1));
  EXPECT_FALSE(before(begun_ - seconds(1)));
}

TEST_F(LookBackTest, FindsBehindManyEntriesAndEndsSomewhere) {
  Add(begun_ - minutes(80), "anna", "login");
  Add(begun_ - minutes(80), "bob", "backup.make");
  for (int i = 0; i < 9000; ++i) Add(begun_ - minutes(70), "bob", "view.scan");
  for (int i = 0; i < 4990; ++i) Add(begun_ - minutes(70), "bob", "login");
  EXPECT_TRUE(web::LoginsBefore(service_, "anna", begun_).last);
  for (int i = 0; i < 20; ++i) Add(begun_ - minutes(60), "bob", "login");
  EXPECT_FALSE(web::LoginsBefore(service_, "anna", begun_).last) << "at most 5000 log-ins";
  ASSERT_TRUE(web::LastEntry(service_, "backup.make"));
  EXPECT_EQ(web::LastEntry(service_, "backup.make")->user, "bob");
}

TEST_F(LookBackTest, AnEmptyLogTellsNothing) {
  EXPECT_FALSE(web::LoginsBefore(service_, "anna", begun_).last);
  EXPECT_EQ(web::LoginsBefore(service_, "anna", begun_).failed, 0);
  EXPECT_FALSE(web::LastEntry(service_, "backup.make"));
}

}  // namespace
}  // namespace plumb::test
