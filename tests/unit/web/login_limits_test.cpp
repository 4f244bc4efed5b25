// SPDX-License-Identifier: Apache-2.0
// The parts that count guesses and know browsers and places, each by itself.
#include <poll.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "web/security/device_cookies.hpp"
#include "web/security/known_places.hpp"
#include "web/security/login_limiter.hpp"
#include "web/security/password_worker.hpp"

namespace plumb::test {
namespace {

TEST(KnownPlacesTest, AreKnownForThirtyDaysAndBounded) {
  using std::chrono::seconds;
  web::KnownPlaces places;
  const auto now = std::chrono::steady_clock::now();
  places.Remember("anna", "10.0.0.1", now);
  EXPECT_TRUE(places.Knows("anna", "10.0.0.1", now + web::KnownPlaces::kKnownFor - seconds(1)));
  EXPECT_FALSE(places.Knows("anna", "10.0.0.1", now + web::KnownPlaces::kKnownFor));
  EXPECT_FALSE(places.Knows("anna", "10.0.0.2", now));
  EXPECT_FALSE(places.Knows("bob", "10.0.0.1", now));
  const auto fill = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i)
      places.Remember("bob", std::to_string(i), now + seconds(i + 1));
  };
  fill(0, web::KnownPlaces::kMaxPlaces - 1);
  EXPECT_TRUE(places.Knows("anna", "10.0.0.1", now)) << "as many as there may be";
  fill(web::KnownPlaces::kMaxPlaces - 1, web::KnownPlaces::kMaxPlaces);
  EXPECT_FALSE(places.Knows("anna", "10.0.0.1", now)) << "one more: the oldest goes";
  EXPECT_TRUE(places.Knows("bob", "0", now));
}

TEST(PasswordWorkerTest, AKnownPersonsPasswordIsCheckedBeforeThoseOfStrangers) {
  web::PasswordWorker worker(4, 16 << 20);
  std::vector<std::string> order;
  const auto verify = [&](const std::string& who, bool trusted) {
    return worker.Verify("guess", "", trusted,
                         [&order, who](std::optional<bool>) { order.push_back(who); });
  };
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(verify("stranger", false)) << i;
  (void)verify("stranger", false);  // in place of the one that the thread may have taken
  EXPECT_FALSE(verify("stranger", false)) << "eight wait";
  EXPECT_TRUE(verify("known", true));
  constexpr int kPatience_ms = 30'000;
  pollfd checked{.fd = worker.fd(), .events = POLLIN, .revents = 0};
  while (order.size() < 9 && ::poll(&checked, 1, kPatience_ms) > 0) worker.Dispatch();
  ASSERT_GE(order.size(), 9U);
  const auto at = std::find(order.begin(), order.end(), "known") - order.begin();
  EXPECT_LE(at, 1) << "after at most the one that was being checked";
}

TEST(LoginLimiterTest, FiveFailuresAMinuteAndNotOneMore) {
  using std::chrono::seconds;
  web::LoginLimiter limiter;
  const auto now = std::chrono::steady_clock::now();
  for (int i = 0; i < 4; ++i) limiter.Failed("a", now);
  EXPECT_EQ(limiter.Wait("a", now), seconds(0)) << "four";
  limiter.Failed("a", now);
  EXPECT_EQ(limiter.Wait("a", now), seconds(60)) << "five";
  EXPECT_EQ(limiter.Wait("b", now), seconds(0));
  EXPECT_EQ(limiter.Wait("a", now + seconds(59)), seconds(1));
  EXPECT_EQ(limiter.Wait("a", now + seconds(60)), seconds(0));
  limiter.Succeeded("a");
  EXPECT_EQ(limiter.Wait("a", now), seconds(0));
}

TEST(LoginLimiterTest, NoFloodOfOtherKeysMakesItForgetOneThatIsSlowedDown) {
  using std::chrono::seconds;
  web::LoginLimiter limiter;
  const auto now = std::chrono::steady_clock::now();
  for (int i = 0; i < 5; ++i) limiter.Failed("name physicist", now);
  for (int i = 0; i < 17'000; ++i) limiter.Failed(fmt::format("address {}", i), now + seconds(1));
  EXPECT_EQ(limiter.Wait("name physicist", now + seconds(2)), seconds(58));
  // What is over makes room for what is new, or a flood of the past would switch it off.
  for (int i = 0; i < 5; ++i) limiter.Failed("name other", now + seconds(100));
  EXPECT_EQ(limiter.Wait("name other", now + seconds(100)), seconds(60));
}

TEST(DeviceCookiesTest, AreBoundToKeyNameAndPassword) {
  const std::string key(32, 'k');
  const web::DeviceCookies cookies(key, false), other(std::string(32, 'j'), false);
  const std::string value = cookies.Make("anna", "hash");
  EXPECT_TRUE(cookies.Identify(value, "anna", "hash"));
  EXPECT_EQ(web::DeviceCookies(key, false).Identify(value, "anna", "hash"),
            cookies.Identify(value, "anna", "hash"))
      << "after a restart";
  EXPECT_FALSE(cookies.Identify(value, "bob", "hash"));
  EXPECT_FALSE(cookies.Identify(value, "anna", "another"));
  EXPECT_FALSE(cookies.Identify(value, "anna", "")) << "a disabled account";
  EXPECT_FALSE(other.Identify(value, "anna", "hash"));
  EXPECT_FALSE(cookies.Identify("", "anna", "hash"));
  EXPECT_FALSE(cookies.Identify(value.substr(0, value.size() - 1), "anna", "hash"));
  EXPECT_NE(cookies.Identify(cookies.Make("anna", "hash"), "anna", "hash"),
            cookies.Identify(value, "anna", "hash"))
      << "each browser is its own";
  EXPECT_NE(cookies.NameFor("anna"), cookies.NameFor("bob"));
  EXPECT_TRUE(web::DeviceCookies(key, true).NameFor("anna").starts_with("__Host-"));
  EXPECT_THROW(web::DeviceCookies("short", false), std::invalid_argument);
}

}  // namespace
}  // namespace plumb::test
