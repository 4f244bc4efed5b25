// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "algo/base/ascii_lower.hpp"
#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

class AccountsTest : public WebTest {};

TEST_F(AccountsTest, FirstStartGivesASetupCodeThatMakesOneEngineer) {
  Start();
  EXPECT_THAT(setup_code_, MatchesRegex("[2-9A-HJ-NP-Z]{4}-[2-9A-HJ-NP-Z]{4}"));
  HttpClient client(port_);
  EXPECT_TRUE(client.Get("/api/v1/session").json().value("setup_required", false));
  EXPECT_EQ(
      client
          .Post("/api/v1/setup", {{"code", "AAAA-AAAA"}, {"name", "eve"}, {"password", kPassword}})
          .status,
      403);
  EXPECT_TRUE(service_.users.empty());
  std::string typed = setup_code_;  // by somebody who leaves out the hyphen and the capitals
  std::erase(typed, '-');
  typed = AsciiLower(typed);
  EXPECT_EQ(
      client.Post("/api/v1/setup", {{"code", typed}, {"name", "eve"}, {"password", kPassword}})
          .status,
      200);
  EXPECT_EQ(
      client
          .Post("/api/v1/setup", {{"code", setup_code_}, {"name", "eve2"}, {"password", kPassword}})
          .status,
      409);
  ASSERT_EQ(service_.users.size(), 1U);
  EXPECT_EQ(service_.users[0].role, Role::kEngineer);
  EXPECT_THAT(service_.users[0].password_hash, HasSubstr("$argon2id$"));
  loop_->Do([&] { EXPECT_FALSE(server_->setup_code().has_value()); });
}

TEST_F(AccountsTest, WhereNoAccountCanBeSeenTheReasonIsShownAndNobodyMakesTheFirst) {
  service_.accounts_fault = Message::Verbatim("the database <plumb.db> is \"damaged\"");
  Start();
  EXPECT_EQ(setup_code_, "");
  HttpClient client(port_);
  const HttpAnswer session = client.Get("/api/v1/session");
  EXPECT_EQ(session.status, 401);
  EXPECT_EQ(session.json().value("setup_required", true), false);
  EXPECT_EQ(session.json().value("fault", ""), service_.accounts_fault.English());
  const HttpAnswer login =
      client.Post("/api/v1/login", {{"name", "engineer"}, {"password", kPassword}});
  EXPECT_EQ(login.status, 503) << "it is not said that name or password are wrong";
  EXPECT_EQ(login.json().value("error", ""),
            "nobody can log in: " + service_.accounts_fault.English());
  const HttpAnswer page = client.Get("/result");
  EXPECT_EQ(page.status, 503);
  EXPECT_THAT(page.body, HasSubstr("the database &lt;plumb.db&gt; is &quot;damaged&quot;"));
  EXPECT_EQ(
      client.Post("/api/v1/setup", {{"code", "AAAA-AAAA"}, {"name", "e"}, {"password", kPassword}})
          .status,
      409);
  // The fault ends, as where another program held the database.
  loop_->Do([&] {
    service_.accounts_fault = {};
    service_.users.push_back({.name = "engineer",
                              .role = Role::kEngineer,
                              .password_hash = "of nobody",
                              .created_at = {}});
  });
  const auto fault = [&] { return client.Get("/api/v1/session").json().value("fault", ""); };
  for (int i = 0; i < 200 && !fault().empty(); ++i) ::usleep(100'000);
  EXPECT_EQ(fault(), "");
  EXPECT_EQ(client.Get("/api/v1/session").json().value("setup_required", true), false);
}

/// The answer to a set-up from an address of this machine; "" is its usual one, 127.0.0.1.
HttpAnswer SetUpFrom(std::uint16_t port, const std::string& address, const std::string& code) {
  const std::string body =
      nlohmann::json{{"code", code}, {"name", "eve"}, {"password", kPassword}}.dump();
  HttpConnection connection(port, address);
  connection.Send(
      "POST /api/v1/setup HTTP/1.1\r\nHost: localhost\r\nContent-Type: " +
      fmt::format("application/json\r\nContent-Length: {}\r\n\r\n{}", body.size(), body));
  return connection.Read();
}

TEST_F(AccountsTest, SetupCodeCannotBeGuessedQuickly) {
  Start();
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(SetUpFrom(port_, "127.0.0.2", "AAAA-AAAA").status, 403) << i;
  const HttpAnswer right = SetUpFrom(port_, "127.0.0.2", setup_code_);
  EXPECT_EQ(right.status, 429);
  EXPECT_FALSE(right.Header("retry-after").empty());
  skipped_s_ = 61;
  EXPECT_EQ(SetUpFrom(port_, "127.0.0.2", setup_code_).status, 200);
}

TEST_F(AccountsTest, WrongSetupCodesFromOneAddressDoNotKeepTheOwnerOut) {
  Start();
  for (int i = 0; i < 8; ++i) (void)SetUpFrom(port_, "127.0.0.2", "AAAA-AAAA");
  EXPECT_EQ(SetUpFrom(port_, "127.0.0.3", setup_code_).status, 200);
}

TEST_F(AccountsTest, WrongSetupCodesFromAllAddressesAreAThousandAMinuteButNeverLockThisMachineOut) {
  Start();
  for (int i = 0; i < 1000; ++i) {
    ASSERT_EQ(SetUpFrom(port_, fmt::format("127.0.{}.1", 1 + i / 5), "AAAA-AAAA").status, 403) << i;
  }
  EXPECT_EQ(SetUpFrom(port_, "127.0.250.1", setup_code_).status, 429);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(SetUpFrom(port_, "", "AAAA-AAAA").status, 403) << i;
  EXPECT_EQ(SetUpFrom(port_, "", setup_code_).status, 429) << "its own guesses are counted";
  skipped_s_ = 61;
  EXPECT_EQ(SetUpFrom(port_, "", setup_code_).status, 200);
}

TEST_F(AccountsTest, WeakOrStrangeAccountsAreRefused) {
  Start();
  HttpClient client(port_);
  const auto set_up = [&](const nlohmann::json& body) {
    return client.Post("/api/v1/setup", body).status;
  };
  EXPECT_EQ(set_up({{"code", setup_code_}, {"name", "eve"}, {"password", "short"}}), 400);
  EXPECT_EQ(set_up({{"code", setup_code_}, {"name", "../eve"}, {"password", kPassword}}), 400);
  EXPECT_EQ(set_up({{"code", setup_code_}, {"name", "Eve"}, {"password", kPassword}}), 400);
  EXPECT_EQ(set_up({{"code", setup_code_}, {"name", "eve"}, {"password", std::string(200, 'x')}}),
            400);
  EXPECT_EQ(
      set_up(
          {{"code", setup_code_}, {"name", "eve"}, {"password", kPassword}, {"role", "engineer"}}),
      400);
  EXPECT_TRUE(service_.users.empty());
}

TEST_F(AccountsTest, CookieIsOutOfReachOfScriptsAndOtherSites) {
  Start();
  SetUpAccounts();
  HttpClient client(port_);
  const HttpAnswer answer =
      client.Post("/api/v1/login", {{"name", "engineer"}, {"password", kPassword}});
  EXPECT_THAT(answer.Header("set-cookie"), HasSubstr("HttpOnly"));
  EXPECT_THAT(answer.Header("set-cookie"), HasSubstr("SameSite=Strict"));
  EXPECT_THAT(answer.body, ::testing::Not(HasSubstr("argon2")));
}

TEST_F(AccountsTest, WrongPasswordAndUnknownNameLookTheSame) {
  Start();
  SetUpAccounts();
  HttpClient client(port_);
  const HttpAnswer wrong =
      client.Post("/api/v1/login", {{"name", "engineer"}, {"password", "not this one"}});
  const HttpAnswer unknown =
      client.Post("/api/v1/login", {{"name", "nobody"}, {"password", "not this one"}});
  EXPECT_EQ(wrong.status, 403);
  EXPECT_EQ(unknown.status, 403);
  EXPECT_EQ(wrong.body, unknown.body);
}

TEST_F(AccountsTest, GuessingIsSlowedDownAndForgottenAfterAMinute) {
  Start();
  SetUpAccounts();
  HttpClient client(port_);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(client.LogIn("engineer", "not this one"), 403);
  EXPECT_EQ(client.LogIn("engineer", kPassword), 429);
  skipped_s_ = 61;
  EXPECT_EQ(client.LogIn("engineer", kPassword), 200);
}

TEST_F(AccountsTest, IdleSessionEndsAndBackgroundRequestsDoNotKeepItAlive) {
  Start();
  SetUpAccounts();
  HttpClient client = LoggedIn("technician");
  skipped_s_ = 14 * 60;
  EXPECT_EQ(client.Get("/api/v1/status").status, 200);
  skipped_s_ = 28 * 60;
  client.extra_headers["X-Plumb-Background"] = "1";
  EXPECT_EQ(client.Get("/api/v1/status").status, 200);
  skipped_s_ = 30 * 60;
  EXPECT_EQ(client.Get("/api/v1/status").status, 401);
}

TEST_F(AccountsTest, BusySessionEndsAfterItsLimit) {
  Start([](web::HttpServerOptions& options) { options.session_limit = std::chrono::hours(1); });
  SetUpAccounts();
  HttpClient client = LoggedIn("technician");
  for (int minute = 10; minute < 60; minute += 10) {
    skipped_s_ = minute * 60;
    EXPECT_EQ(client.Get("/api/v1/status").status, 200) << minute;
  }
  skipped_s_ = 3600;
  EXPECT_EQ(client.Get("/api/v1/status").status, 401);
}

TEST_F(AccountsTest, OldCookieIsWorthlessAfterLogout) {
  Start();
  SetUpAccounts();
  HttpClient client = LoggedIn("technician");
  const std::string cookie = client.cookie;
  EXPECT_EQ(client.Post("/api/v1/logout").status, 200);
  client.cookie = cookie;
  EXPECT_EQ(client.Get("/api/v1/status").status, 401);
}

TEST_F(AccountsTest, DisablingAnAccountEndsItsSessions) {
  Start();
  SetUpAccounts();
  HttpClient technician = LoggedIn("technician");
  HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(engineer
                .Put("/api/v1/users/technician", {{"role", "technician"},
                                                  {"disabled", true},
                                                  {"password", ""},
                                                  {"own_password", kPassword}})
                .status,
            200);
  EXPECT_EQ(technician.Get("/api/v1/status").status, 401);
  EXPECT_EQ(technician.LogIn("technician", kPassword), 403);
  EXPECT_EQ(engineer
                .Put("/api/v1/users/engineer", {{"role", "technician"},
                                                {"disabled", false},
                                                {"password", ""},
                                                {"own_password", kPassword}})
                .status,
            409);
}

TEST_F(AccountsTest, OwnPasswordNeedsTheOldOneAndEndsOtherSessions) {
  Start();
  SetUpAccounts();
  HttpClient first = LoggedIn("physicist"), second = LoggedIn("physicist");
  EXPECT_EQ(first
                .Post("/api/v1/session/password",
                      {{"old_password", "wrong"}, {"password", "another long one"}})
                .status,
            403);
  EXPECT_EQ(first
                .Post("/api/v1/session/password",
                      {{"old_password", kPassword}, {"password", "another long one"}})
                .status,
            200);
  EXPECT_EQ(first.Get("/api/v1/status").status, 200);
  EXPECT_EQ(second.Get("/api/v1/status").status, 401);
  EXPECT_EQ(second.LogIn("physicist", "another long one"), 200);
}

TEST_F(AccountsTest, RolesReachOnlyWhatIsTheirs) {
  Start();
  SetUpAccounts();
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist"),
             engineer = LoggedIn("engineer");
  EXPECT_EQ(technician.Get("/api/v1/users").status, 403);
  EXPECT_EQ(physicist.Get("/api/v1/users").status, 403);
  EXPECT_EQ(engineer.Get("/api/v1/users").status, 200);
  EXPECT_EQ(
      technician
          .Post("/api/v1/users", {{"name", "evil"}, {"role", "engineer"}, {"password", kPassword}})
          .status,
      403);
  EXPECT_EQ(technician
                .Put("/api/v1/users/technician",
                     {{"role", "engineer"}, {"disabled", false}, {"password", ""}})
                .status,
            403);
  EXPECT_EQ(technician.Get("/api/v1/audit").status, 403);
  EXPECT_EQ(physicist.Get("/api/v1/audit").status, 200);
  EXPECT_EQ(technician.Post("/api/v1/references/x/approve", {{"revision", 1}}).status, 403);
  EXPECT_EQ(engineer.Post("/api/v1/references/x/approve", {{"revision", 1}}).status, 403);
  EXPECT_EQ(physicist
                .Post("/api/v1/references/x/approve",
                      {{"revision", 1}, {"digest", "of x"}, {"password", kPassword}})
                .status,
            404);
  EXPECT_EQ(service_.users.size(), 4U);
}

TEST_F(AccountsTest, LanguageAndThemeBelongToTheAccount) {
  const std::string code(Catalogues().back()->code);
  Start();
  SetUpAccounts();
  HttpClient here = LoggedIn("technician"), elsewhere = LoggedIn("technician");
  HttpClient other = LoggedIn("physicist");
  EXPECT_TRUE(here.Get("/api/v1/session").json()["preferences"]["language"].is_null());
  const auto choose = [&](const std::string& language, const char* theme) {
    return here.Put("/api/v1/session/preferences", {{"language", language}, {"theme", theme}})
        .status;
  };
  EXPECT_EQ(choose(code, "light"), 200);
  EXPECT_EQ(elsewhere.Get("/api/v1/session").json()["preferences"],
            (nlohmann::json{{"language", code}, {"theme", "light"}}));
  EXPECT_TRUE(other.Get("/api/v1/session").json()["preferences"]["language"].is_null());
  EXPECT_EQ(choose("xx", "light"), 400);
  EXPECT_EQ(choose(code, "pink"), 400);
}

TEST_F(AccountsTest, ARecordThatCannotBeReadIsTheAnswerToASignatureAndEndsNothing) {
  Start();
  SetUpAccounts();
  HttpClient physicist = LoggedIn("physicist");
  loop_->Do([&] { service_.is_unreadable = true; });
  const HttpAnswer answer =
      physicist.Post("/api/v1/references/x/approve",
                     {{"revision", 1}, {"digest", "of x"}, {"password", kPassword}});
  EXPECT_EQ(answer.status, 500);
  EXPECT_THAT(answer.body, HasSubstr("its plan cannot be read"));
  EXPECT_EQ(physicist.Get("/api/v1/status").status, 200);
}

TEST_F(AccountsTest, LoginWithoutScriptLeadsToTheResult) {
  Start();
  SetUpAccounts();
  HttpClient client(port_);
  EXPECT_THAT(client.Get("/result").body, HasSubstr("<form method=\"post\" action=\"/login\""));
  client.extra_headers["Content-Type"] = "application/x-www-form-urlencoded";
  const HttpAnswer answer =
      client.Ask("POST", "/login", "name=technician&password=correct+horse%20battery");
  EXPECT_EQ(answer.status, 303);
  EXPECT_EQ(answer.Header("location"), "/result");
  client.extra_headers.clear();
  EXPECT_THAT(client.Get("/result").body, HasSubstr("No result yet"));
}

TEST_F(AccountsTest, PasswordsThatArriveTogetherAreCountedTogether) {
  Start();
  SetUpAccounts();
  std::vector<HttpConnection> connections;
  const std::string body = R"({"name":"engineer","password":"not this one"})";
  for (int i = 0; i < 12; ++i) {
    connections.emplace_back(port_);
    connections.back().Send(
        "POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: "
        "application/json\r\nContent-Length: " +
        std::to_string(body.size()) + "\r\n\r\n" + body);
  }
  int judged = 0;
  for (HttpConnection& connection : connections) judged += connection.Read().status == 403 ? 1 : 0;
  EXPECT_GE(judged, 1);
  EXPECT_LE(judged, 5);
}

}  // namespace
}  // namespace plumb::test
