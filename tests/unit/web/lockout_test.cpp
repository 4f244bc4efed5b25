// SPDX-License-Identifier: Apache-2.0
// Who may guess how often, and who is not kept out by others who guess.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <atomic>
#include <numeric>

#include "algo/base/ascii_lower.hpp"
#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {
namespace {

using ::testing::HasSubstr;

constexpr const char* kWrong = "not this one at all";

class LockoutTest : public WebTest {
 protected:
  /// The screen in the room.
  static void Pair(HttpClient& screen, HttpClient& engineer) {
    const nlohmann::json pairing = screen.Post("/api/v1/displays/pair").json();
    ASSERT_EQ(engineer
                  .Post("/api/v1/displays",
                        {{"code", pairing["code"]}, {"name", "room"}, {"password", kPassword}})
                  .status,
              201);
    ASSERT_EQ(screen.Post("/api/v1/displays/claim", {{"secret", pairing["secret"]}}).status, 200);
  }
  void SetUp() override {
    Start([this](web::HttpServerOptions& options) {
      options.on_guesses = [this](bool are_running) { guessed_ = are_running; };
    });
    SetUpAccounts();
  }
  std::atomic<bool> guessed_ = false;
  /// @param headers  More of them, each with the end of its line.
  HttpConnection Sent(const std::string& address, const std::string& path, const std::string& type,
                      const std::string& body, const std::string& headers = {}) const {
    HttpConnection connection(port_, address);
    connection.Send(
        fmt::format("POST {} HTTP/1.1\r\nHost: localhost\r\n{}Content-Type: {}\r\n"
                    "Content-Length: {}\r\n\r\n{}",
                    path, headers, type, body.size(), body));
    return connection;
  }
  /// The status of a login from an address, with the cookies of a browser.
  int LogInFrom(const std::string& address, const std::string& name, const std::string& password,
                const HttpClient* browser = nullptr, const std::string& presence = {}) {
    std::string cookies;
    if (browser != nullptr) {
      for (const auto& [key, value] : browser->device_cookies)
        cookies += (cookies.empty() ? "Cookie: " : "; ") + key + "=" + value;
    }
    return Sent(address, "/api/v1/login", "application/json",
                nlohmann::json{{"name", name}, {"password", password}, {"presence", presence}}
                    .dump(),
                cookies.empty() ? "" : cookies + "\r\n")
        .Read()
        .status;
  }
  /// What `plumb presence` shows.
  std::string OnConsole() {
    std::string code;
    loop_->Do([&] { code = server_->presence_code(); });
    return code;
  }
  static std::string Typed(std::string code) {
    std::erase(code, '-');
    code = AsciiLower(code);
    return code;
  }
  /// Enough addresses to slow a name down for those that are not known.
  void GuessFromFiveAddresses(const std::string& name) {
    for (int i = 1; i <= 5; ++i) (void)LogInFrom(fmt::format("127.0.1.{}", i), name, kWrong);
  }
};

TEST_F(LockoutTest, AnAddressThatTriesManyNamesIsSlowedDown) {
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(LogInFrom("127.0.0.2", "name" + std::to_string(i), kWrong), 403) << i;
  EXPECT_EQ(LogInFrom("127.0.0.2", "technician", kPassword), 429) << "a sixth name";
  EXPECT_EQ(LogInFrom("127.0.0.3", "technician", kPassword), 200) << "another address";
  skipped_s_ = 61;
  EXPECT_EQ(LogInFrom("127.0.0.2", "technician", kPassword), 200);
}

TEST_F(LockoutTest, ANameThatIsTriedFromManyAddressesIsSlowedDown) {
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(LogInFrom("127.0.0." + std::to_string(10 + i), "technician", kWrong), 403) << i;
  EXPECT_EQ(LogInFrom("127.0.0.20", "technician", kPassword), 429) << "a sixth address";
  EXPECT_EQ(LogInFrom("127.0.0.20", "physicist", kPassword), 200) << "another name";
}

TEST_F(LockoutTest, OneAddressThatGuessesLocksOutItselfAlone) {
  for (int i = 0; i < 5; ++i) EXPECT_EQ(LogInFrom("127.0.0.2", "technician", kWrong), 403) << i;
  EXPECT_FALSE(guessed_);
  EXPECT_EQ(LogInFrom("127.0.0.2", "technician", kPassword), 429);
  EXPECT_TRUE(guessed_) << "shown on page and light";
  EXPECT_EQ(LogInFrom("127.0.0.3", "technician", kPassword), 200) << "another address";
}

TEST_F(LockoutTest, FourAddressesLockNobodyElseOutAndFiveDoForAMinute) {
  const auto guess = [&](int first, int last) {
    for (int i = first; i <= last; ++i) {
      for (int k = 0; k < 6; ++k)
        EXPECT_EQ(LogInFrom(fmt::format("127.0.1.{}", i), "technician", kWrong), k < 5 ? 403 : 429);
    }
  };
  guess(1, 4);
  EXPECT_EQ(LogInFrom("127.0.0.3", "technician", kPassword), 200);
  skipped_s_ += 61;
  guess(1, 4);
  // Who mistyped before the name was slowed down may go on.
  EXPECT_EQ(LogInFrom("127.0.0.4", "technician", kWrong), 403);
  EXPECT_EQ(LogInFrom("127.0.0.5", "technician", kPassword), 429) << "a sixth";
  EXPECT_EQ(LogInFrom("127.0.0.4", "technician", kPassword), 200);
  skipped_s_ += 61;
  // An address that goes on guessing counts anew each minute.
  guess(1, 5);
  EXPECT_EQ(LogInFrom("127.0.0.5", "technician", kPassword), 429);
  skipped_s_ += 61;
  EXPECT_EQ(LogInFrom("127.0.0.5", "technician", kPassword), 200);
}

/// A workstation that forgets its cookies at each log-out.
TEST_F(LockoutTest, AnAddressFromWhichThePersonLoggedInBeforeIsNotLockedOutByOthers) {
  ASSERT_EQ(LogInFrom("127.0.0.5", "technician", kPassword), 200);
  for (const char* name : {"technician", "physicist"}) GuessFromFiveAddresses(name);
  EXPECT_EQ(LogInFrom("127.0.0.6", "technician", kPassword), 429) << "another address";
  EXPECT_EQ(LogInFrom("127.0.0.5", "physicist", kPassword), 429) << "another person";
  for (int i = 0; i < 4; ++i) EXPECT_EQ(LogInFrom("127.0.0.5", "technician", kWrong), 403) << i;
  EXPECT_EQ(LogInFrom("127.0.0.5", "technician", kPassword), 200);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(LogInFrom("127.0.0.5", "technician", kWrong), 403) << i;
  EXPECT_EQ(LogInFrom("127.0.0.5", "technician", kPassword), 429) << "its own guesses count";
}

TEST_F(LockoutTest, ABrowserThatLoggedInBeforeIsNotLockedOutByOthers) {
  const HttpClient browser = LoggedIn("technician");
  ASSERT_EQ(browser.device_cookies.size(), 1U);
  GuessFromFiveAddresses("technician");
  for (int i = 0; i < 8; ++i) (void)LogInFrom("127.0.0.2", "technician", kWrong);
  EXPECT_EQ(LogInFrom("127.0.0.3", "technician", kPassword), 429) << "a browser that is not known";
  EXPECT_EQ(LogInFrom("127.0.0.3", "technician", kPassword, &browser), 200);
  EXPECT_EQ(LogInFrom("127.0.0.2", "technician", kPassword, &browser), 200)
      << "even beside the one who guesses";
}

/// The right password from the room is never refused because of others who guess.
TEST_F(LockoutTest, WhoSeesAScreenInTheRoomIsNotLockedOutByOthers) {
  HttpClient engineer = LoggedIn("engineer"), screen(port_);
  Pair(screen, engineer);
  const auto shown = [&] { return screen.Get("/api/v1/displays/presence").json()["code"]; };
  EXPECT_TRUE(shown().is_null()) << "nobody guesses";
  EXPECT_FALSE(guessed_);
  for (int i = 0; i < 30; ++i)
    (void)LogInFrom("127.0.1." + std::to_string(1 + i), "technician", kWrong);
  EXPECT_TRUE(guessed_) << "shown on page and light";
  std::string from = "127.0.0.7";
  const auto log_in = [&](const std::string& presence, const char* password) {
    return LogInFrom(from, "technician", password, nullptr, presence);
  };
  EXPECT_EQ(log_in("", kPassword), 429);
  EXPECT_EQ(log_in("2222-2222", kPassword), 429) << "a code that no screen shows";
  const std::string code = shown();
  EXPECT_EQ(code.size(), 9U);
  EXPECT_EQ(log_in(code, kPassword), 200);
  from = "127.0.0.8";
  EXPECT_EQ(log_in(Typed(code), kPassword), 200) << "small letters without the dash";
  EXPECT_EQ(HttpClient(port_).Get("/api/v1/displays/presence").status, 401);
  EXPECT_EQ(engineer.Get("/api/v1/displays/presence").status, 404);
  EXPECT_EQ(OnConsole(), code);
  // Whoever is in the room guesses no faster than others.
  for (int i = 0; i < 5; ++i) EXPECT_EQ(log_in(code, kWrong), 403) << i;
  EXPECT_EQ(log_in(code, kPassword), 429);
}

TEST_F(LockoutTest, CodesOfPresenceChangeAndTheOneBeforeIsTakenForTenMoreMinutes) {
  const std::string code = OnConsole();
  skipped_s_ += 599;
  EXPECT_EQ(OnConsole(), code);
  skipped_s_ += 2;
  EXPECT_NE(OnConsole(), code);
  GuessFromFiveAddresses("technician");
  EXPECT_EQ(LogInFrom("127.0.0.3", "technician", kPassword, nullptr, code), 200);
  skipped_s_ += 600;
  (void)OnConsole();
  GuessFromFiveAddresses("technician");
  EXPECT_EQ(LogInFrom("127.0.0.4", "technician", kPassword, nullptr, code), 429);
  EXPECT_EQ(LogInFrom("127.0.0.4", "technician", kPassword, nullptr, OnConsole()), 200);
}

/// The page without script has a field for the code, too.
TEST_F(LockoutTest, TheFormWithoutScriptTakesTheCode) {
  EXPECT_THAT(HttpClient(port_).Get("/result").body, HasSubstr("name=\"presence\""));
  GuessFromFiveAddresses("technician");
  const auto post = [&](const std::string& presence) {
    const std::string body =
        fmt::format("name=technician&password={}&presence={}", "correct+horse+battery", presence);
    return Sent("127.0.0.9", "/login", "application/x-www-form-urlencoded", body).Read().status;
  };
  EXPECT_EQ(post(""), 429);
  EXPECT_EQ(post(std::string(33, 'A')), 400);
  EXPECT_EQ(post(OnConsole()), 303);
}

TEST_F(LockoutTest, ThePairedScreenItselfIsNotLockedOut) {
  HttpClient engineer = LoggedIn("engineer"), screen(port_);
  Pair(screen, engineer);
  GuessFromFiveAddresses("technician");
  EXPECT_EQ(LogInFrom("127.0.0.3", "technician", kPassword), 429);
  EXPECT_EQ(screen.LogIn("technician", kPassword), 200);
}

/// Passwords that take a few tenths of a second to check, as on the appliance.
class SlowPasswordTest : public LockoutTest {
 protected:
  void SetUp() override {
    Start([](web::HttpServerOptions& options) {
      options.password_operations = 12;
      options.password_memory_bytes = 32 << 20;
    });
    SetUpAccounts();
  }
  /// Eight wait and one is being checked. On a busy machine one check may end before the next
  /// request is read, so that one call may not be enough.
  void SendGuesses() {
    for (int i = 0; i < 16; ++i) {
      const std::string body =
          nlohmann::json{{"name", fmt::format("name{}", i)}, {"password", kWrong}}.dump();
      guesses_.push_back(
          Sent(fmt::format("127.0.2.{}", 1 + i), "/api/v1/login", "application/json", body));
    }
  }
  std::vector<HttpConnection> guesses_;
};

TEST_F(SlowPasswordTest, WhatWasNotLookedAtIsNoGuess) {
  int unseen = 0;
  for (int round = 0; round < 5 && unseen < 6; ++round) {
    SendGuesses();
    unseen = 0;
    while (unseen < 6 && LogInFrom("127.0.3.1", "physicist", kPassword) == 503) ++unseen;
  }
  EXPECT_EQ(unseen, 6) << "the queue was never full";
  for (HttpConnection& guess : guesses_) (void)guess.Read();
  EXPECT_EQ(LogInFrom("127.0.3.1", "physicist", kPassword), 200);
}

TEST_F(SlowPasswordTest, ABrowserThatLoggedInBeforeIsServedWhileGuessesFromManyAddressesWait) {
  const HttpClient browser = LoggedIn("technician");
  bool refused = false;
  for (int round = 0; round < 5 && !refused; ++round) {
    SendGuesses();
    refused = LogInFrom("127.0.3.1", "physicist", kPassword) == 503;
  }
  EXPECT_TRUE(refused) << "an unknown browser was let in although the queue was full";
  EXPECT_EQ(LogInFrom("127.0.3.2", "technician", kPassword, &browser), 200);
  int guesses_refused = 0;
  for (HttpConnection& guess : guesses_) guesses_refused += guess.Read().status == 503 ? 1 : 0;
  EXPECT_GE(guesses_refused, 16 - 10);
}

TEST_F(LockoutTest, AKnownBrowserIsSlowedDownByItsOwnGuessesAlone) {
  const HttpClient browser = LoggedIn("technician"), other = LoggedIn("technician");
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(LogInFrom("127.0.0.2", "technician", kWrong, &browser), 403) << i;
  EXPECT_EQ(LogInFrom("127.0.0.2", "technician", kPassword, &browser), 429);
  EXPECT_EQ(LogInFrom("127.0.0.2", "technician", kPassword, &other), 200) << "another browser";
  EXPECT_EQ(LogInFrom("127.0.0.2", "physicist", kPassword), 200)
      << "a colleague at the same screen";
  skipped_s_ = 61;
  EXPECT_EQ(LogInFrom("127.0.0.2", "technician", kPassword, &browser), 200);
}

TEST_F(LockoutTest, ADeviceCookieHelpsOnlyItsOwnNameAndEndsWithThePassword) {
  HttpClient browser = LoggedIn("technician");
  HttpClient forged = browser;
  for (auto& [key, value] : forged.device_cookies) value.back() = value.back() == '0' ? '1' : '0';
  for (const char* name : {"technician", "physicist"}) GuessFromFiveAddresses(name);
  EXPECT_EQ(LogInFrom("127.0.0.3", "technician", kPassword, &forged), 429);
  EXPECT_EQ(LogInFrom("127.0.0.3", "physicist", kPassword, &browser), 429) << "another name";
  const HttpClient old = browser;
  EXPECT_EQ(browser
                .Post("/api/v1/session/password",
                      {{"old_password", kPassword}, {"password", "another long one"}})
                .status,
            200);
  EXPECT_EQ(LogInFrom("127.0.0.3", "technician", "another long one", &old), 429)
      << "a copy from before the change";
  EXPECT_EQ(LogInFrom("127.0.0.3", "technician", "another long one", &browser), 200);
}

TEST_F(LockoutTest, GuessesAtTheLoginDoNotKeepWhoIsLoggedInFromSigning) {
  HttpClient client = LoggedIn("technician");
  GuessFromFiveAddresses("technician");
  const auto sign = [&](const std::string& password) {
    return client
        .Post("/api/v1/scans/none/accept-outside", {{"reason", "because"}, {"password", password}})
        .status;
  };
  EXPECT_EQ(sign(kPassword), 404) << "no such scan, but the password was right";
  for (int i = 0; i < 5; ++i) EXPECT_EQ(sign(kWrong), 403) << i;
  EXPECT_EQ(sign(kPassword), 429) << "guesses at the signature are counted";
}

TEST_F(LockoutTest, TheCookieIsOutOfReachOfScriptsAndLastsForAYear) {
  const HttpAnswer answer =
      HttpClient(port_).Post("/api/v1/login", {{"name", "engineer"}, {"password", kPassword}});
  const auto [begin, end] = answer.headers.equal_range("set-cookie");
  const std::string both =
      std::accumulate(begin, end, std::string(), [](const std::string& text, const auto& header) {
        return header.second.find("plumb_device_") == 0 ? text + header.second : text;
      });
  for (const char* part : {"HttpOnly", "SameSite=Strict", "Path=/", "Max-Age=31536000"})
    EXPECT_THAT(both, HasSubstr(part));
}

}  // namespace
}  // namespace plumb::test
