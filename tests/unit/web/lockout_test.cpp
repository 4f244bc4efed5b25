// SPDX-License-Identifier: Apache-2.0
// Who may guess how often, and who is not kept out by others who guess; which passwords are taken.
#include <unistd.h>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <numeric>

#include "tests/unit/web/web_fixture.hpp"
#include "web/security/device_cookies.hpp"
#include "web/security/known_places.hpp"
#include "web/security/login_limiter.hpp"
#include "web/security/password_rules.hpp"
#include "web/security/password_worker.hpp"

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
  /// The status of a login from an address, with the cookies of a browser.
  int LogInFrom(const std::string& address, const std::string& name, const std::string& password,
                const HttpClient* browser = nullptr, const std::string& presence = {}) {
    std::string cookies;
    if (browser != nullptr) {
      for (const auto& [key, value] : browser->device_cookies)
        cookies += (cookies.empty() ? "Cookie: " : "; ") + key + "=" + value;
    }
    const std::string body =
        nlohmann::json{{"name", name}, {"password", password}, {"presence", presence}}.dump();
    HttpConnection connection(port_, address);
    connection.Send("POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\n" +
                    (cookies.empty() ? "" : cookies + "\r\n") +
                    "Content-Type: application/json\r\nContent-Length: " +
                    std::to_string(body.size()) + "\r\n\r\n" + body);
    return connection.Read().status;
  }
  /// What `plumb presence` shows.
  std::string OnConsole() {
    std::string code;
    loop_->Do([&] { code = server_->presence_code(); });
    return code;
  }
  static std::string Typed(std::string code) {
    std::erase(code, '-');
    for (char& c : code) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
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
    HttpConnection connection(port_, "127.0.0.9");
    connection.Send(
        fmt::format("POST /login HTTP/1.1\r\nHost: localhost\r\nContent-Type: "
                    "application/x-www-form-urlencoded\r\nContent-Length: {}\r\n\r\n{}",
                    body.size(), body));
    return connection.Read().status;
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
};

TEST_F(SlowPasswordTest, ABrowserThatLoggedInBeforeIsServedWhileGuessesFromManyAddressesWait) {
  const HttpClient browser = LoggedIn("technician");
  std::vector<HttpConnection> guesses;
  const auto send_guesses = [&] {
    for (int i = 0; i < 16; ++i) {
      const std::string body =
          nlohmann::json{{"name", fmt::format("name{}", i)}, {"password", kWrong}}.dump();
      guesses.emplace_back(port_, fmt::format("127.0.2.{}", 1 + i));
      guesses.back().Send(
          fmt::format("POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: "
                      "application/json\r\nContent-Length: {}\r\n\r\n{}",
                      body.size(), body));
    }
  };
  // Eight wait and one is being checked. On a busy machine one check may end before the next
  // request is read, so there is more than one try.
  bool refused = false;
  for (int round = 0; round < 5 && !refused; ++round) {
    send_guesses();
    refused = LogInFrom("127.0.3.1", "physicist", kPassword) == 503;
  }
  EXPECT_TRUE(refused) << "an unknown browser was let in although the queue was full";
  EXPECT_EQ(LogInFrom("127.0.3.2", "technician", kPassword, &browser), 200);
  int guesses_refused = 0;
  for (HttpConnection& guess : guesses) guesses_refused += guess.Read().status == 503 ? 1 : 0;
  EXPECT_GE(guesses_refused, 16 - 10);
}

TEST(PasswordWorkerTest, AKnownPersonsPasswordIsCheckedBeforeThoseOfStrangers) {
  web::PasswordWorker worker(4, 16 << 20);
  std::vector<std::string> order;
  const auto verify = [&](const std::string& who, bool trusted) {
    return worker.Verify("guess", "", trusted, [&order, who](bool) { order.push_back(who); });
  };
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(verify("stranger", false)) << i;
  (void)verify("stranger", false);  // in place of the one that the thread may have taken
  EXPECT_FALSE(verify("stranger", false)) << "eight wait";
  EXPECT_TRUE(verify("known", true));
  for (int i = 0; i < 600 && order.size() < 9; ++i) {
    ::usleep(50'000);
    worker.Dispatch();
  }
  ASSERT_GE(order.size(), 9U);
  const auto at = std::find(order.begin(), order.end(), "known") - order.begin();
  EXPECT_LE(at, 1) << "after at most the one that was being checked";
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

TEST_F(LockoutTest, TheMachineIsRestartedForAnEngineerWithThePassword) {
  HttpClient engineer = LoggedIn("engineer");
  const auto restart = [&](const nlohmann::json& body) {
    return engineer.Post("/api/v1/update/restart", body);
  };
  EXPECT_EQ(restart(nlohmann::json::object()).status, 400);
  EXPECT_EQ(restart({{"password", kWrong}}).status, 403);
  EXPECT_EQ(LoggedIn("physicist").Post("/api/v1/update/restart", {{"password", kPassword}}).status,
            403);
  EXPECT_EQ(service_.num_restarts, 0);
  service_.update.installing = true;
  const HttpAnswer answer = restart({{"password", kPassword}});
  EXPECT_EQ(answer.status, 409);
  EXPECT_THAT(answer.body, HasSubstr("being installed"));
  service_.update.installing = false;
  EXPECT_EQ(restart({{"password", kPassword}}).status, 200);
  EXPECT_EQ(service_.num_restarts, 1);
}

TEST_F(LockoutTest, AFactoryResetIsForAnEngineerWithThePassword) {
  HttpClient engineer = LoggedIn("engineer");
  const auto reset = [](HttpClient& client, const char* kind, const std::string& password) {
    return client.Post("/api/v1/system/factory-reset", {{"kind", kind}, {"password", password}})
        .status;
  };
  EXPECT_EQ(reset(engineer, "wipe", kWrong), 403);
  EXPECT_EQ(reset(engineer, "everything", kPassword), 400);
  HttpClient physicist = LoggedIn("physicist");
  EXPECT_EQ(reset(physicist, "wipe", kPassword), 403);
  service_.status.session = TreatmentSession{};
  EXPECT_EQ(reset(engineer, "wipe", kPassword), 409);
  EXPECT_FALSE(service_.factory_reset);
  service_.status.session.reset();
  EXPECT_EQ(reset(engineer, "keep_records", kPassword), 200);
  EXPECT_EQ(service_.factory_reset, FactoryReset::kKeepRecords);
  EXPECT_EQ(reset(engineer, "wipe", kPassword), 200);
  EXPECT_EQ(service_.factory_reset, FactoryReset::kWipe);
}

TEST_F(LockoutTest, TheRoomsCalibrationIsSignedByAPhysicistOrAnEngineerWithThePassword) {
  service_.is_board_there = true;
  service_.status.sensor.present = true;
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  const auto room = [&] { return technician.Get("/api/v1/room-calibration").json(); };
  const auto sign = [&](HttpClient& client, const std::string& digest, const char* password) {
    return client
        .Post("/api/v1/room-calibration/sign", {{"digest", digest}, {"password", password}})
        .status;
  };
  EXPECT_EQ(room()["versions"].size(), 0U);
  EXPECT_TRUE(room()["shift_mm"].is_null());
  CheckRecord check;
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(sign(physicist, std::string(64, 'a'), kPassword), 409) << i << " scans";
    service_.SeeBoard(check);
  }
  const std::string digest = room()["digest"];
  EXPECT_EQ(room()["scans"].size(), 3U);
  EXPECT_EQ(room()["scans"][0]["num_markers"], 4);
  EXPECT_EQ(room()["why_not_sign"], "");
  EXPECT_EQ(sign(technician, digest, kPassword), 403);
  EXPECT_EQ(sign(physicist, digest, kWrong), 403);
  EXPECT_EQ(sign(physicist, digest + "0", kPassword), 400) << "no digest";
  EXPECT_EQ(sign(physicist, std::string(64, 'b'), kPassword), 409) << "another one than was read";
  EXPECT_EQ(physicist.Post("/api/v1/room-calibration/sign", {{"digest", digest}}).status, 400);
  EXPECT_EQ(room()["versions"].size(), 0U);
  EXPECT_EQ(sign(physicist, digest, kPassword), 201);
  EXPECT_EQ(room()["versions"][0]["signed_by"], "physicist");
  EXPECT_EQ(room()["versions"][0]["digest"], digest);
  EXPECT_EQ(sign(physicist, digest, kPassword), 409) << "its scans are used up";
  EXPECT_EQ(service_.audit.back().action, "room.calibrate");

  const auto board = technician.Get("/api/v1/room-calibration/board.pdf");
  EXPECT_EQ(board.status, 200);
  EXPECT_EQ(board.body.substr(0, 5), "%PDF-");
  service_.status.sensor.present = false;
  EXPECT_EQ(technician.Get("/api/v1/room-calibration/board.pdf").status, 409);
}

TEST_F(LockoutTest, ASensorProfileIsSeenByAllAndChangedByAnEngineerWithThePassword) {
  const auto version = [](int number, int sweeps) {
    SensorProfileVersion one;
    one.version = number;
    one.cause = ProfileCause::kLearned;
    one.num_sweeps = sweeps;
    one.values = {{"depth_scale", 0.992}};
    return one;
  };
  service_.profiles.serial = "S1";
  service_.profiles.versions = {version(2, 2), version(1, 1)};
  HttpClient engineer = LoggedIn("engineer");
  const auto newest = [&] {
    return LoggedIn("technician").Get("/api/v1/sensor-profile").json()["versions"][0];
  };
  EXPECT_EQ(newest()["num_sweeps"], 2);
  EXPECT_EQ(newest()["values"]["depth_scale"], 0.992);
  EXPECT_EQ(engineer.Get("/api/v1/sensor-profile/2/file").status, 200);
  for (const char* none : {"3", "x", "-1", "99999999999999"})
    EXPECT_EQ(engineer.Get(std::string("/api/v1/sensor-profile/") + none + "/file").status, 404);
  const auto post = [&](HttpClient& client, const char* act, nlohmann::json body) {
    return client.Post(std::string("/api/v1/sensor-profile/") + act, body).status;
  };
  EXPECT_EQ(post(engineer, "reset", {{"serial", "S1"}}), 400);
  EXPECT_EQ(post(engineer, "reset", {{"serial", "S1"}, {"password", kWrong}}), 403);
  HttpClient physicist = LoggedIn("physicist");
  EXPECT_EQ(post(physicist, "reset", {{"serial", "S1"}, {"password", kPassword}}), 403);
  EXPECT_EQ(post(engineer, "reset", {{"serial", "S2"}, {"password", kPassword}}), 409);
  EXPECT_EQ(newest()["version"], 2);
  EXPECT_EQ(post(engineer, "reset", {{"serial", "S1"}, {"password", kPassword}}), 200);
  EXPECT_EQ(newest()["version"], 3);
  EXPECT_EQ(newest()["num_sweeps"], 0);
  const auto roll_back = [&](int wanted, const char* password) {
    return post(engineer, "roll-back",
                {{"serial", "S1"}, {"version", wanted}, {"password", password}});
  };
  EXPECT_EQ(roll_back(1, kWrong), 403);
  EXPECT_EQ(roll_back(3, kPassword), 404) << "it holds no profile";
  EXPECT_EQ(roll_back(0, kPassword), 400);
  EXPECT_EQ(roll_back(1, kPassword), 200);
  EXPECT_EQ(newest()["num_sweeps"], 1);
  EXPECT_EQ(newest()["cause"], "rolled_back");
}

TEST_F(LockoutTest, ARollBackIsShownUntilAnEngineerHasSeenIt) {
  service_.status.rolled_back = service_.update.rolled_back =
      Message::Verbatim("version 2 was installed, but");
  HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(engineer.Get("/api/v1/status").json()["rolled_back"], "version 2 was installed, but");
  EXPECT_EQ(engineer.Get("/api/v1/update").json()["rolled_back"], "version 2 was installed, but");
  EXPECT_EQ(engineer.Post("/api/v1/update/seen").status, 200);
  EXPECT_EQ(engineer.Get("/api/v1/status").json()["rolled_back"], nullptr);
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

TEST_F(LockoutTest, WhoWasGivenAPasswordChangesItBeforeAnythingElse) {
  HttpClient engineer = LoggedIn("engineer");
  ASSERT_EQ(engineer
                .Post("/api/v1/users", {{"name", "dora"},
                                        {"role", "physicist"},
                                        {"password", kFirstPassword},
                                        {"own_password", kPassword}})
                .status,
            201);
  HttpClient dora(port_);
  ASSERT_EQ(dora.LogIn("dora", kFirstPassword), 200);
  EXPECT_EQ(dora.Get("/api/v1/session").json()["password_change_required"], true);
  for (const char* path : {"/api/v1/status", "/api/v1/patients", "/api/v1/audit", "/api/v1/events"})
    EXPECT_EQ(dora.Get(path).status, 403) << path;
  EXPECT_EQ(dora.Post("/api/v1/press").status, 403);
  EXPECT_THAT(dora.Get("/result").body, HasSubstr("Log in"));
  const auto change = [&](const std::string& password) {
    return dora
        .Post("/api/v1/session/password",
              {{"old_password", kFirstPassword}, {"password", password}})
        .status;
  };
  EXPECT_EQ(change(kFirstPassword), 400) << "the old one again";
  EXPECT_EQ(change(kPassword), 200);
  EXPECT_EQ(dora.Get("/api/v1/status").status, 200);
  EXPECT_EQ(dora.Get("/api/v1/session").json()["password_change_required"], false);
  HttpClient again(port_);
  EXPECT_EQ(again.LogIn("dora", kPassword), 200);
  EXPECT_EQ(again.Get("/api/v1/status").status, 200);
  // A password reset by an engineer starts in the same state; one's own change does not.
  EXPECT_EQ(engineer
                .Put("/api/v1/users/dora",
                     {{"password", "yet another horse"}, {"own_password", kPassword}})
                .status,
            200);
  EXPECT_EQ(again.LogIn("dora", "yet another horse"), 200);
  EXPECT_EQ(again.Get("/api/v1/status").status, 403);
  HttpClient own(port_);
  EXPECT_EQ(engineer
                .Post("/api/v1/session/password",
                      {{"old_password", kPassword}, {"password", "an own new horse"}})
                .status,
            200);
  EXPECT_EQ(own.LogIn("engineer", "an own new horse"), 200);
  EXPECT_EQ(own.Get("/api/v1/users").status, 200);
}

/// An open session alone changes nothing about accounts, passwords and screens.
TEST_F(LockoutTest, AnOpenSessionWithoutThePasswordChangesNoAccountAndPairsNoScreen) {
  HttpClient engineer = LoggedIn("engineer"), screen(port_);
  const nlohmann::json pairing = screen.Post("/api/v1/displays/pair").json();
  const nlohmann::json user = {
      {"name", "eve"}, {"role", "physicist"}, {"password", kFirstPassword}};
  const nlohmann::json display = {{"code", pairing["code"]}, {"name", "room"}};
  const auto with = [](nlohmann::json body, const char* field, const char* password) {
    body[field] = password;
    return body;
  };
  const std::vector<User> before = service_.users;
  for (const auto& [field, password, status] :
       {std::tuple{"x", "x", 400}, {"own_password", kWrong, 403}}) {
    EXPECT_EQ(engineer.Post("/api/v1/users", with(user, field, password)).status, status);
    for (const nlohmann::json& change : {nlohmann::json{{"role", "technician"}},
                                         {{"disabled", true}},
                                         {{"password", "yet another horse"}}})
      EXPECT_EQ(engineer.Put("/api/v1/users/second", with(change, field, password)).status, status);
    skipped_s_ += 61;
  }
  EXPECT_EQ(engineer.Post("/api/v1/displays", display).status, 400);
  EXPECT_EQ(engineer.Post("/api/v1/displays", with(display, "password", kWrong)).status, 403);
  EXPECT_EQ(service_.users.size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(service_.users[i].password_hash, before[i].password_hash);
    EXPECT_EQ(service_.users[i].role, before[i].role);
    EXPECT_FALSE(service_.users[i].disabled);
  }
  EXPECT_TRUE(service_.displays.empty());
  EXPECT_EQ(engineer.Post("/api/v1/displays", with(display, "password", kPassword)).status, 201);
  const std::string paired = "/api/v1/displays/" + service_.displays.at(0).id;
  EXPECT_EQ(engineer.Ask("DELETE", paired, "").status, 415);
  EXPECT_EQ(engineer.Ask("DELETE", paired, R"({"password":"not this one at all"})").status, 403);
  EXPECT_EQ(service_.displays.size(), 1U);
  EXPECT_EQ(engineer.Ask("DELETE", paired, nlohmann::json{{"password", kPassword}}.dump()).status,
            200);
}

TEST_F(LockoutTest, ThePasswordOfOnesOwnIsChangedWithTheOldOneAlone) {
  HttpClient engineer = LoggedIn("engineer");
  const auto change = [&](const char* own) {
    return engineer
        .Put("/api/v1/users/engineer", {{"password", "an own new horse"}, {"own_password", own}})
        .status;
  };
  EXPECT_EQ(change(kPassword), 400);
  EXPECT_EQ(change(kWrong), 400);
  HttpClient again(port_);
  EXPECT_EQ(again.LogIn("engineer", kPassword), 200) << "it is the old one still";
}

TEST_F(LockoutTest, CommonPasswordsAreRefusedWhereverOneIsSet) {
  HttpClient engineer = LoggedIn("engineer");
  const auto add = [&](const std::string& name, const std::string& password) {
    return engineer
        .Post("/api/v1/users", {{"name", name},
                                {"role", "technician"},
                                {"password", password},
                                {"own_password", kPassword}})
        .status;
  };
  EXPECT_EQ(add("dora", "password12"), 400);
  EXPECT_EQ(add("radiographer", "radiographer"), 400);
  EXPECT_EQ(engineer
                .Put("/api/v1/users/technician",
                     {{"password", "Qwertyuiop1!"}, {"own_password", kPassword}})
                .status,
            400);
  EXPECT_EQ(engineer
                .Post("/api/v1/session/password",
                      {{"old_password", kPassword}, {"password", "iloveyou2024"}})
                .status,
            400);
  EXPECT_EQ(add("dora", kFirstPassword), 201);
}

TEST(PasswordRulesTest, WhatIsTriedFirstIsRefusedAndALengthOfTenIsEnough) {
  for (const char* bad :
       {"password12", "PASSWORD12", "Passw0rd!!!", "1234567890", "qwertyuiop", "administrator",
        "Krankenhaus1", "aaaaaaaaaaaa", "abababababab", "12341234123412", "linaclinac",
        "changeme!!!", "mueller2024", "muellermueller", "Mueller!!!!!"}) {
    EXPECT_FALSE(web::WhyNotPassword(bad, "mueller").empty()) << bad;
  }
  for (const char* good : {"correct horse battery", "kx7-tree-boat", "mueller likes tea",
                           "8402 5519 33", "passwordless sea", "\xC3\xA4pfel und birnen"}) {
    EXPECT_TRUE(web::WhyNotPassword(good, "mueller").empty()) << good;
  }
  EXPECT_FALSE(web::WhyNotPassword("ninebytes", "x").empty());
  EXPECT_TRUE(web::WhyNotPassword("ten bytes!", "x").empty());
  EXPECT_TRUE(web::WhyNotPassword("ab" + std::string(125, 'x') + "c", "x").empty());
  EXPECT_FALSE(web::WhyNotPassword("ab" + std::string(126, 'x') + "c", "x").empty());
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
