// SPDX-License-Identifier: Apache-2.0
// Recognising paired displays by their cookies.
#include "web/api/displays.hpp"

#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "algo/base/ascii_lower.hpp"
#include "web/security/secrets.hpp"

namespace plumb::web {
namespace {

/// The database of paired displays; empty while it is not open.
class DisplaysInMemory : public DisplayService {
 public:
  std::vector<Display> Displays() override {
    ++reads;
    return displays;
  }
  void AddDisplay(const Actor&, const Display& display, Done done) override {
    displays.push_back(display);
    done({});
  }
  void RemoveDisplay(const Actor&, const std::string&, Done) override {}

  std::vector<Display> displays;
  int reads = 0;
};

class Background : public BackgroundWork {
 public:
  bool RunInBackground(BackgroundPool, std::function<void()>, std::function<void()>) override {
    return false;
  }
};

Request WithCookieOf(const std::string& token) {
  Request request;
  request.headers["cookie"] = "plumb_display=" + token;
  return request;
}

TEST(DisplaysTest, IsKnownOnceADatabaseThatOpenedLateCanBeRead) {
  DisplaysInMemory service;
  Displays::TimePoint now{std::chrono::hours(1)};
  Displays displays(service, false, [&] { return now; });
  EXPECT_EQ(displays.SessionOf(WithCookieOf("token")), nullptr);

  service.displays.push_back({.id = "1",
                              .name = "room",
                              .token_hash = StoredHashOf("token"),
                              .paired_at = {},
                              .paired_by = "engineer"});
  now += std::chrono::seconds(5);
  const auto session = displays.SessionOf(WithCookieOf("token"));
  ASSERT_NE(session, nullptr);
  EXPECT_EQ(session->user, "display room");
  EXPECT_EQ(displays.SessionOf(WithCookieOf("another")), nullptr);
}

TEST(DisplaysTest, AStreamOfWrongCookiesDoesNotReadTheDatabaseEachTime) {
  DisplaysInMemory service;
  Displays::TimePoint now{std::chrono::hours(1)};
  Displays displays(service, false, [&] { return now; });
  for (int i = 0; i < 1000; ++i) {
    now += std::chrono::milliseconds(10);
    EXPECT_EQ(displays.SessionOf(WithCookieOf("wrong")), nullptr);
  }
  EXPECT_LE(service.reads, 3);  // at first, and every 5 s
}

class PairingTest : public ::testing::Test {
 protected:
  /// The code that a screen at this address is given.
  std::string Asked(const std::string& address) {
    Request request;
    request.address = address;
    std::string code;
    router_.Find("POST", "/api/v1/displays/pair").route->handler(request, [&](Response response) {
      code = nlohmann::json::parse(response.body)["code"];
    });
    return code;
  }
  bool IsPairedBy(const std::string& code) {
    ChangeResult result = ChangeResult::kDone;
    displays_.Approve({.user = "engineer", .address = {}}, code, "room",
                      [&](const Change& change) { result = change.result; });
    return result == ChangeResult::kDone;
  }

  DisplaysInMemory service_;
  Displays::TimePoint now_{std::chrono::hours(1)};
  Displays displays_{service_, false, [this] { return now_; }};
  Background background_;
  Router router_;
  Routes routes_{router_, background_};

  void SetUp() override { displays_.AddRoutes(routes_); }
};

TEST_F(PairingTest, AnAddressHasTwoScreensWaitingAndTheNewestStay) {
  const std::string first = Asked("10.0.0.1"), second = Asked("10.0.0.1"),
                    third = Asked("10.0.0.1");
  EXPECT_FALSE(IsPairedBy(first));
  EXPECT_TRUE(IsPairedBy(second));
  EXPECT_TRUE(IsPairedBy(third));
}

TEST_F(PairingTest, ACodeIsTypedWithOrWithoutItsHyphen) {
  std::string code = Asked("10.0.0.1");
  std::erase(code, '-');
  code = AsciiLower(code);
  EXPECT_FALSE(IsPairedBy(code.substr(1)));
  EXPECT_TRUE(IsPairedBy(code.insert(2, " ")));
}

TEST_F(PairingTest, WhoAsksAgainAndAgainKeepsNoOtherScreenOut) {
  const std::string real = Asked("10.0.0.1");
  for (int i = 0; i < 100; ++i) EXPECT_NE(Asked("10.0.0.66"), "");
  // From as many addresses as there are places, each twice.
  for (int i = 0; i < 6; ++i) EXPECT_NE(Asked("10.0.1." + std::to_string(i / 2)), "");
  EXPECT_TRUE(IsPairedBy(real));
  EXPECT_TRUE(IsPairedBy(Asked("10.0.0.2"))) << "and a newcomer finds a place";
  now_ += std::chrono::minutes(11);
  EXPECT_FALSE(IsPairedBy(real)) << "ten minutes";
}

}  // namespace
}  // namespace plumb::web
