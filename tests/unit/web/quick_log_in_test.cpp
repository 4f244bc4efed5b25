// SPDX-License-Identifier: Apache-2.0
// A PIN within a shift: who may use it where, with which rights, and when only the password helps.
#include <gmock/gmock.h>

#include "tests/unit/web/web_fixture.hpp"
#include "web/security/quick_logins.hpp"

namespace plumb::test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

TEST(QuickLogInsTest, APinHasFourToEightDigitsAndIsNoRow) {
  for (const char* good : {"4711", "12345679", "AB12CD34", "00127734009"})
    EXPECT_EQ(web::WhyNotPin(good).English(), "") << good;
  for (const char* bad : {"", "471", "abc1", "AB12CD3", "4711 ", "1111", "1234", "87654321",
                          "123456789", "111111111"})
    EXPECT_NE(web::WhyNotPin(bad).English(), "") << bad;
  EXPECT_EQ(web::WhyNotPin(std::string(64, 'a')).English(), "");
  EXPECT_NE(web::WhyNotPin(std::string(65, 'a')).English(), "");
}

TEST(QuickLogInsTest, AShiftAndThreeTriesEachInItsBrowser) {
  web::QuickLogIns quick;
  const web::QuickLogIns::TimePoint begun{};
  const auto end = begun + web::QuickLogIns::kShift;
  quick.Open("a", "anna", begun);
  quick.Open("b", "anna", begun);
  EXPECT_THAT(quick.People(begun), ::testing::ElementsAre("anna"));
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(quick.UseTry("a", "anna", begun)) << i;
  EXPECT_FALSE(quick.UseTry("a", "anna", begun));
  quick.GiveBack("a", "anna");
  EXPECT_EQ(quick.TriesLeft("a", "anna", begun), 1) << "it was not looked at";
  EXPECT_TRUE(quick.UseTry("a", "anna", begun));
  quick.GiveBack("b", "anna");
  EXPECT_EQ(quick.TriesLeft("b", "anna", begun), 3) << "another browser";
  EXPECT_EQ(quick.TriesLeft("b", "bob", begun), 0);
  EXPECT_EQ(quick.TriesLeft("b", "anna", end - std::chrono::seconds(1)), 3);
  EXPECT_EQ(quick.TriesLeft("b", "anna", end), 0);
  quick.Open("a", "anna", begun);
  EXPECT_EQ(quick.TriesLeft("a", "anna", begun), 3) << "the password was typed again";
  quick.EndAllOf("anna");
  EXPECT_TRUE(quick.People(begun).empty());
}

class QuickLogInTest : public WebTest {
 protected:
  void SetUp() override {
    Start();
    SetUpAccounts();
  }
  int SetPin(HttpClient& client, const std::string& pin) {
    return client.Put("/api/v1/session/pin", {{"pin", pin}, {"password", kPassword}}).status;
  }
  static json People(HttpClient& client) {
    return client.Get("/api/v1/login/people").json()["people"];
  }
  static HttpAnswer LogInQuickly(HttpClient& client, const std::string& name,
                                 const std::string& pin) {
    HttpAnswer answer = client.Post("/api/v1/login/pin", {{"name", name}, {"pin", pin}});
    if (answer.status == 200) client.FetchToken();
    return answer;
  }
};

TEST_F(QuickLogInTest, OpensASessionWithTheRightsOfATechnicianInTheSameBrowserOnly) {
  HttpClient physicist = LoggedIn("physicist");
  EXPECT_EQ(People(physicist), json::array()) << "no PIN yet";
  EXPECT_EQ(
      physicist.Put("/api/v1/session/pin", {{"pin", "4711"}, {"password", "wrong one"}}).status,
      403)
      << "it is signed";
  EXPECT_EQ(SetPin(physicist, "1234"), 400);
  EXPECT_EQ(SetPin(physicist, "4711"), 200);
  EXPECT_EQ(physicist.Get("/api/v1/session").json()["has_pin"], true);
  EXPECT_EQ(physicist.Post("/api/v1/logout").status, 200);
  EXPECT_EQ(People(physicist), json::array({"physicist"}));
  HttpClient elsewhere(port_);
  EXPECT_EQ(People(elsewhere), json::array());
  EXPECT_EQ(LogInQuickly(elsewhere, "physicist", "4711").status, 403);
  ASSERT_EQ(LogInQuickly(physicist, "physicist", "4711").status, 200);
  const json session = physicist.Get("/api/v1/session").json();
  EXPECT_EQ(session["is_quick"], true);
  EXPECT_EQ(session["role"], "physicist");
  EXPECT_EQ(session["permissions"],
            LoggedIn("technician").Get("/api/v1/session").json()["permissions"]);
  EXPECT_EQ(physicist.Post("/api/v1/patients", {{"code", "PX-1"}, {"site", ""}}).status, 201);
  EXPECT_THAT(physicist.Put("/api/v1/templates", json::object()).body,
              HasSubstr("your role is not allowed to do this"));
  EXPECT_EQ(physicist.Get("/api/v1/audit").status, 403);
}

TEST_F(QuickLogInTest, GivesNobodyARightThatTheirRoleLacks) {
  HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(SetPin(engineer, "4711"), 200);
  ASSERT_EQ(LogInQuickly(engineer, "engineer", "4711").status, 200);
  EXPECT_EQ(engineer.Post("/api/v1/patients", {{"code", "PX-1"}, {"site", ""}}).status, 403);
  EXPECT_EQ(engineer.Get("/api/v1/users").status, 403);
  EXPECT_EQ(engineer.Get("/api/v1/patients").status, 200);
}

TEST_F(QuickLogInTest, ThreeWrongTriesTenHoursANewPasswordAndTheOwnerEndIt) {
  HttpClient client = LoggedIn("technician");
  EXPECT_EQ(SetPin(client, "4711"), 200);
  for (const char* left : {"2 more tries", "one more try", "log in with the password"}) {
    const HttpAnswer answer = LogInQuickly(client, "technician", "4712");
    EXPECT_EQ(answer.status, 403);
    EXPECT_THAT(answer.body, HasSubstr(left));
  }
  EXPECT_EQ(People(client), json::array());
  EXPECT_EQ(LogInQuickly(client, "technician", "4711").status, 403) << "not even the right one";
  EXPECT_EQ(client.LogIn("technician", kPassword), 200);
  EXPECT_EQ(LogInQuickly(client, "technician", "4711").status, 200);

  skipped_s_ = 10 * 3600;
  EXPECT_EQ(People(client), json::array());
  EXPECT_EQ(LogInQuickly(client, "technician", "4711").status, 403) << "the shift is over";
  EXPECT_EQ(client.LogIn("technician", kPassword), 200);
  EXPECT_EQ(LogInQuickly(client, "technician", "4711").status, 200);

  HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(engineer
                .Put("/api/v1/users/technician",
                     {{"password", "another long one"}, {"own_password", kPassword}})
                .status,
            200);
  EXPECT_EQ(LogInQuickly(client, "technician", "4711").status, 403) << "another password";

  EXPECT_EQ(SetPin(engineer, "4711"), 200);
  EXPECT_EQ(engineer.Ask("DELETE", "/api/v1/session/pin", R"({"password": "wrong"})").status, 403);
  EXPECT_EQ(
      engineer.Ask("DELETE", "/api/v1/session/pin", json{{"password", kPassword}}.dump()).status,
      200);
  EXPECT_EQ(LogInQuickly(engineer, "engineer", "4711").status, 403) << "removed";
  EXPECT_TRUE(service_.pins.contains("technician"));
}

TEST_F(QuickLogInTest, AnotherPersonTakesOverInOneRequest) {
  HttpClient room = LoggedIn("technician");
  EXPECT_EQ(room.LogIn("second", kPassword), 200);
  EXPECT_EQ(SetPin(room, "4711"), 200);
  EXPECT_EQ(room.LogIn("technician", kPassword), 200);
  HttpClient before = room;
  EXPECT_EQ(People(room), json::array({"second"}));
  const auto hand_over = [&](const char* pin) {
    return room.Post("/api/v1/session/hand-over", {{"name", "second"}, {"pin", pin}}).status;
  };
  EXPECT_EQ(hand_over("4712"), 403);
  EXPECT_EQ(before.Get("/api/v1/status").status, 200) << "who is there stays";
  EXPECT_EQ(hand_over("4711"), 200);
  room.FetchToken();
  EXPECT_EQ(room.Get("/api/v1/session").json()["user"], "second");
  EXPECT_EQ(before.Get("/api/v1/status").status, 401);
  const json log = LoggedIn("engineer").Get("/api/v1/audit").json()["entries"];
  std::string said;
  for (const json& entry : log)
    said += entry["action"].get<std::string>() + ' ' + entry["user"].get<std::string>() + ", ";
  EXPECT_THAT(said, HasSubstr("login.pin second, session.hand_over technician, "));
  EXPECT_THAT(said, HasSubstr("login.failed second"));
}

}  // namespace
}  // namespace plumb::test
