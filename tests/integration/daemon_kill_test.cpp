// SPDX-License-Identifier: Apache-2.0
// A real plumbd that is killed while its page is open and people work on it: what the page said was
// stored is there afterwards, and nothing else is half.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <random>
#include <set>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "daemon/records/store.hpp"
#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"

namespace plumb {
namespace {

using test::HttpClient;
using test::HttpConnection;
using testing::Plumbd;

class DaemonKillTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  /// Adds patients until nobody answers, and notes what was confirmed.
  void Work(HttpClient& client, int round) {
    for (int i = 0;; ++i) {
      const std::string code = fmt::format("K{}x{}", round, i);
      const test::HttpAnswer answer =
          client.Post("/api/v1/patients", {{"code", code}, {"site", "thorax"}});
      if (answer.status == 0) return;
      ASSERT_LT(answer.status, 300) << answer.body;
      confirmed_.insert(code);
    }
  }

  /// One life: the page's stream is open, one person works, another sweeps; then the kill.
  void LiveUntilKilled(int round) {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    plumbd.WaitForState("ready");
    HttpClient viewer(plumbd.port()), tom(plumbd.port());
    ASSERT_EQ(tom.LogIn("tom", test::kPassword), 200);
    ASSERT_EQ(viewer.LogIn("engineer", test::kPassword), 200);
    HttpConnection events(plumbd.port());
    ASSERT_TRUE(events.Send(
        "GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\nCookie: " + viewer.cookie + "\r\n\r\n"));
    ASSERT_NE(events.ReadUntil("event: "), "");
    std::thread person([&] { Work(tom, round); });
    if (round % 2 == 0) plumbd.Press();
    const auto until =
        std::chrono::steady_clock::now() + std::chrono::milliseconds(random_() % 1500);
    // Any moment is wanted; the stream is read as a browser reads it.
    while (std::chrono::steady_clock::now() < until) (void)plumbd.Status();
    plumbd.Signal(SIGKILL);
    EXPECT_EQ(plumbd.Wait(), -SIGKILL);
    person.join();
    EXPECT_TRUE(events.IsClosedBySoon()) << "a page that is open learns it";
  }

  /// Of the rows that were confirmed, how many are gone.
  [[nodiscard]] std::size_t NumLost() const {
    Store store(folder_ / "state");
    EXPECT_EQ(store.users.List().size(), 2U);
    EXPECT_FALSE(store.audit.FirstBroken());
    EXPECT_EQ(store.recovery().lost_scans, 0);
    return static_cast<std::size_t>(
        std::count_if(confirmed_.begin(), confirmed_.end(),
                      [&](const std::string& code) { return !store.patients.FindByCode(code); }));
  }

  testing::TempFolder folder_;
  std::mt19937 random_{43};
  std::set<std::string> confirmed_;  ///< Codes of patients.
};

TEST_F(DaemonKillTest, WithThePageOpenNothingThatWasConfirmedIsLost) {
  const char* const text = std::getenv("PLUMB_KILLS_WITH_PAGE");
  const int rounds = text != nullptr ? std::atoi(text) : 3;
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    HttpClient engineer = plumbd.MakeFirstAccount();
    ASSERT_EQ(engineer.LogIn("engineer", test::kPassword), 200);
    ASSERT_TRUE(test::AddAccount(plumbd.port(), engineer, "tom", "technician"));
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  for (int round = 0; round < rounds; ++round) {
    ASSERT_NO_FATAL_FAILURE(LiveUntilKilled(round)) << round;
    ASSERT_EQ(NumLost(), 0U) << round;
  }
  EXPECT_FALSE(confirmed_.empty());
  std::printf("%d kills with the page open: %zu rows confirmed, 0 of these lost\n", rounds,
              confirmed_.size());
}

}  // namespace
}  // namespace plumb
