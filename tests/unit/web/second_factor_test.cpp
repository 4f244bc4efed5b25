// SPDX-License-Identifier: Apache-2.0
// Codes of an authenticator against the table of RFC 6238, and a log-in, a signature and the list
// of sessions with them.
#include "web/security/second_factor.hpp"
#include "web/model/plain_code.hpp"
#include "web/security/secrets.hpp"

#include <gmock/gmock.h>

#include <set>

#include "algo/base/ascii_lower.hpp"
#include "algo/base/errors.hpp"
#include "tests/unit/web/web_fixture.hpp"
#include "web/security/sessions.hpp"

namespace plumb::test {
namespace {

using nlohmann::json;
using std::chrono::seconds;
using std::chrono::system_clock;
using ::testing::HasSubstr;

/// "12345678901234567890", the key of the RFC.
constexpr const char* kSecret = "GEZDGNBVGY3TQOJQGEZDGNBVGY3TQOJQ";

system_clock::time_point At(std::int64_t seconds_since_1970) {
  return system_clock::from_time_t(seconds_since_1970);
}

TEST(SecondFactorTest, CodesAreThoseOfTheTableOfTheRfc) {
  for (const auto& [time, code] : {std::pair<std::int64_t, const char*>{59, "287082"},
                                   {1111111109, "081804"},
                                   {1111111111, "050471"},
                                   {1234567890, "005924"},
                                   {2000000000, "279037"},
                                   {20000000000, "353130"}})
    EXPECT_EQ(web::TotpCode(kSecret, time / 30), code) << time;
  EXPECT_EQ(web::TotpStep(At(59)), 1);
  EXPECT_EQ(web::TotpStep(At(60)), 2);
  for (const char* bad : {"", "A", "a", "1", "GEZDGNBVGY3TQOJQ="})
    EXPECT_THROW((void)web::TotpCode(bad, 1), DataError) << bad;
}

TEST(SecondFactorTest, ACodeCountsOnceAndForOneStepOnEitherSide) {
  const SecondFactor factor{.secret = kSecret, .last_step = 0, .recovery_hashes = {}};
  const auto now = At(1'800'000'015);
  const auto used = [&](const SecondFactor& of, int step) {
    return web::UsedSecondFactor(of, web::TotpCode(kSecret, web::TotpStep(now) + step), now);
  };
  for (const int step : {-1, 0, 1}) {
    const auto left = used(factor, step);
    ASSERT_TRUE(left) << step;
    EXPECT_EQ(left->last_step, web::TotpStep(now) + step);
    EXPECT_FALSE(used(*left, step)) << "the same again";
    EXPECT_FALSE(used(*left, step - 1)) << "one before it";
  }
  EXPECT_FALSE(used(factor, -2));
  EXPECT_FALSE(used(factor, 2));
  for (const char* bad : {"", "12345", "1234567", "abcdef"})
    EXPECT_FALSE(web::UsedSecondFactor(factor, bad, now)) << bad;
}

TEST(SecondFactorTest, ARecoveryCodeCountsOnceHoweverItIsTyped) {
  const std::vector<std::string> codes = web::MakeRecoveryCodes();
  EXPECT_EQ(std::set(codes.begin(), codes.end()).size(), 10U);
  const SecondFactor factor{
      .secret = kSecret, .last_step = 0, .recovery_hashes = web::HashesOf(codes)};
  const std::string typed = AsciiLower(codes[3]);
  const auto left = web::UsedSecondFactor(factor, " " + typed, At(0));
  ASSERT_TRUE(left);
  EXPECT_EQ(left->recovery_hashes.size(), 9U);
  EXPECT_FALSE(web::UsedSecondFactor(*left, codes[3], At(0)));
  EXPECT_TRUE(web::UsedSecondFactor(*left, codes[4], At(0)));
  EXPECT_TRUE(web::UsedSecondFactor(*left, PlainCode(codes[5]), At(0))) << "no hyphen";
  for (const std::string& hash : factor.recovery_hashes)
    EXPECT_FALSE(web::UsedSecondFactor(factor, hash, At(0))) << "what is stored is no code";
}

TEST(SecondFactorTest, SecretsAreOf160BitsAndNewEachTime) {
  const std::string secret = web::MakeTotpSecret();
  EXPECT_EQ(secret.size(), 32U);
  EXPECT_NE(secret, web::MakeTotpSecret());
  EXPECT_NE(web::TotpCode(secret, 1), "");
  EXPECT_EQ(web::OtpauthUri("anna", "ABC"), "otpauth://totp/Plumb:anna?secret=ABC&issuer=Plumb");
}

class AuthenticatorTest : public WebTest {
 protected:
  void SetUp() override {
    Start();
    SetUpAccounts();
  }
  /// The code of a step that was not used yet.
  std::string NextCode() {
    const std::int64_t present = web::TotpStep(system_clock::now());
    step_ = std::max(step_ + 1, present - 1);
    return web::TotpCode(secret_, step_);
  }
  /// Sets one up as the page does. @return the recovery codes.
  json SetOneUp(HttpClient& client) {
    const json offered =
        client.Post("/api/v1/session/second-factor/offer", {{"password", kPassword}}).json();
    secret_ = offered.value("secret", "");
    EXPECT_THAT(offered.value("uri", ""), HasSubstr(secret_));
    const HttpAnswer done = client.Post("/api/v1/session/second-factor", {{"code", NextCode()}});
    EXPECT_EQ(done.status, 200);
    return done.json()["recovery_codes"];
  }
  HttpAnswer LogInWith(const std::string& name, const std::string& code) {
    return HttpClient(port_).Post(
        "/api/v1/login", {{"name", name}, {"password", kPassword}, {"second_factor", code}});
  }

  std::string secret_;
  std::int64_t step_ = 0;
};

TEST_F(AuthenticatorTest, WhoHasOneNeedsItToLogInAndToSign) {
  HttpClient physicist = LoggedIn("physicist"), other = LoggedIn("physicist");
  EXPECT_EQ(SetOneUp(physicist).size(), 10U);
  EXPECT_EQ(other.Get("/api/v1/status").status, 401) << "begun with the password alone";
  EXPECT_EQ(physicist.Get("/api/v1/session").json()["second_factor"], true);

  HttpClient alone(port_);
  const HttpAnswer asked =
      alone.Post("/api/v1/login", {{"name", "physicist"}, {"password", kPassword}});
  EXPECT_EQ(asked.status, 403);
  EXPECT_EQ(asked.json()["second_factor_required"], true);
  EXPECT_EQ(asked.Header("set-cookie"), "");
  const HttpAnswer guess =
      alone.Post("/api/v1/login", {{"name", "physicist"}, {"password", "not this one at all"}});
  EXPECT_FALSE(guess.json().contains("second_factor_required")) << "not before the password";
  EXPECT_EQ(LogInWith("physicist", "000000").status, 403);
  const std::string code = NextCode();
  EXPECT_EQ(LogInWith("physicist", code).status, 200);
  EXPECT_EQ(LogInWith("physicist", code).status, 403) << "used already";
  EXPECT_EQ(LoggedIn("technician").Get("/api/v1/session").json()["second_factor"], false);

  const auto sign = [&](json body) {
    body["digest"] = std::string(64, 'a');
    return physicist.Post("/api/v1/room-calibration/sign", body);
  };
  const std::string next = NextCode();
  EXPECT_EQ(sign({{"password", kPassword}}).json()["second_factor_required"], true);
  EXPECT_EQ(sign({{"password", kPassword}, {"second_factor", "000000"}}).status, 403);
  EXPECT_EQ(sign({{"password", "not this one at all"}, {"second_factor", next}}).status, 403);
  EXPECT_EQ(sign({{"password", kPassword}, {"second_factor", next}}).status, 409)
      << "no board was seen, but the signature was right";
}

TEST_F(AuthenticatorTest, ARecoveryCodeLetsInOnceAndAnEngineerRemovesALostOne) {
  HttpClient physicist = LoggedIn("physicist"), engineer = LoggedIn("engineer");
  const json codes = SetOneUp(physicist);
  EXPECT_EQ(LogInWith("physicist", codes[0]).status, 200);
  EXPECT_EQ(LogInWith("physicist", codes[0]).status, 403);
  const json listed = engineer.Get("/api/v1/users").json();
  for (const json& user : listed.at("users"))
    EXPECT_EQ(user["second_factor"], user["name"] == "physicist") << user["name"];
  const auto remove = [&](json body) {
    body["remove_second_factor"] = true;
    return engineer.Put("/api/v1/users/physicist", body).status;
  };
  EXPECT_EQ(remove(json::object()), 400);
  EXPECT_EQ(remove({{"own_password", "not this one at all"}}), 403);
  EXPECT_EQ(remove({{"own_password", kPassword}, {"role", "engineer"}}), 400) << "by itself";
  EXPECT_EQ(remove({{"own_password", kPassword}}), 200);
  HttpClient again(port_);
  EXPECT_EQ(again.LogIn("physicist", kPassword), 200);
  const json told = again.Get("/api/v1/session/last-login").json()["changes"];
  ASSERT_GE(told.size(), 1U);
  EXPECT_EQ(told[0]["action"], "user.second_factor_off");
  EXPECT_EQ(told[0]["user"], "engineer");
}

TEST_F(AuthenticatorTest, OnesOwnIsSetUpAndRemovedWithThePasswordAlone) {
  HttpClient physicist = LoggedIn("physicist"), technician = LoggedIn("technician");
  EXPECT_EQ(
      technician.Post("/api/v1/session/second-factor/offer", {{"password", kPassword}}).status,
      403);
  EXPECT_EQ(physicist.Post("/api/v1/session/second-factor", {{"code", "123456"}}).status, 409);
  EXPECT_EQ(
      physicist.Post("/api/v1/session/second-factor/offer", {{"password", "not this one at all"}})
          .status,
      403);
  (void)SetOneUp(physicist);
  const auto remove = [&](const json& body) {
    return physicist.Ask("DELETE", "/api/v1/session/second-factor", body.dump()).status;
  };
  EXPECT_EQ(remove({{"password", kPassword}}), 403);
  EXPECT_EQ(remove({{"password", kPassword}, {"second_factor", NextCode()}}), 200);
  EXPECT_TRUE(service_.second_factors.empty());
  HttpClient again(port_);
  EXPECT_EQ(again.LogIn("physicist", kPassword), 200);
}

TEST_F(AuthenticatorTest, APersonSeesAndEndsTheirOwnSessionsOnly) {
  HttpClient one = LoggedIn("physicist"), other = LoggedIn("second");
  EXPECT_EQ(one.Post("/api/v1/session/end-others").status, 200);
  HttpClient two = LoggedIn("physicist"), three = LoggedIn("physicist");
  const auto list = [&] { return one.Get("/api/v1/session/list").json()["sessions"]; };
  ASSERT_EQ(list().size(), 3U);
  EXPECT_EQ(list()[0]["is_this"], false) << "the newest first";
  EXPECT_EQ(list()[2]["is_this"], true);
  EXPECT_EQ(list()[0]["address"], "127.0.0.1");
  const std::string id = list()[0]["id"];
  EXPECT_EQ(other.Ask("DELETE", "/api/v1/session/list/" + id, "").status, 404);
  EXPECT_EQ(one.Ask("DELETE", "/api/v1/session/list/" + id, "").status, 200);
  EXPECT_EQ(three.Get("/api/v1/status").status, 401);
  EXPECT_EQ(two.Get("/api/v1/status").status, 200);
  EXPECT_EQ(one.Post("/api/v1/session/end-others").status, 200);
  EXPECT_EQ(two.Get("/api/v1/status").status, 401);
  EXPECT_EQ(one.Get("/api/v1/status").status, 200);
  EXPECT_EQ(other.Get("/api/v1/status").status, 200);
}

TEST_F(AuthenticatorTest, TheOwnerIsToldOfWhatWasChangedAboutTheAccount) {
  HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(engineer
                .Put("/api/v1/users/second",
                     {{"password", "yet another horse"}, {"own_password", kPassword}})
                .status,
            200);
  EXPECT_EQ(
      engineer.Put("/api/v1/users/technician", {{"disabled", false}, {"own_password", kPassword}})
          .status,
      200);
  HttpClient second(port_);
  EXPECT_EQ(second.LogIn("second", "yet another horse"), 200);
  const json told = second.Get("/api/v1/session/last-login").json();
  ASSERT_GE(told["changes"].size(), 1U) << told.dump();
  EXPECT_EQ(told["changes"][0]["action"], "user.change");
  EXPECT_EQ(told["changes"][0]["user"], "engineer");
  EXPECT_EQ(second
                .Post("/api/v1/session/password",
                      {{"old_password", "yet another horse"}, {"password", kPassword}})
                .status,
            200);
  HttpClient again = LoggedIn("second");
  const json then = again.Get("/api/v1/session/last-login").json()["changes"];
  ASSERT_GE(then.size(), 1U);
  EXPECT_EQ(then[0]["user"], "second") << "also by a thief of the session";
  for (const json& change : then) EXPECT_EQ(change["subject"], "second");
}

TEST(SessionsTest, IdleTimeIsByRoleAndAnAccountHasSixteenSessions) {
  web::Sessions sessions;
  sessions.SetLimits(std::chrono::hours(4), std::chrono::hours(12));
  EXPECT_EQ(sessions.IdleOf(Role::kTechnician), std::chrono::hours(4));
  EXPECT_EQ(sessions.IdleOf(Role::kPhysicist), std::chrono::minutes(30));
  EXPECT_EQ(sessions.IdleOf(Role::kEngineer), std::chrono::minutes(10));
  sessions.SetLimits(std::chrono::minutes(5), std::chrono::hours(12));
  for (const Role role : {Role::kTechnician, Role::kPhysicist, Role::kEngineer})
    EXPECT_EQ(sessions.IdleOf(role), std::chrono::minutes(5));

  sessions.SetLimits(std::chrono::hours(4), std::chrono::hours(12));
  web::Sessions::TimePoint now{std::chrono::hours(100)};
  const auto open = [&](const char* name, Role role) {
    User user;
    user.name = name;
    user.role = role;
    now += seconds(1);
    return sessions.Open(user, "10.0.0.1", now);
  };
  const auto engineer = open("engineer", Role::kEngineer), anna = open("anna", Role::kTechnician);
  EXPECT_TRUE(sessions.Find(engineer.token, now + std::chrono::minutes(9), false));
  EXPECT_FALSE(sessions.Find(engineer.token, now + std::chrono::minutes(11), false));
  EXPECT_TRUE(sessions.Find(anna.token, now + std::chrono::minutes(11), false));
  std::vector<web::Sessions::Opened> many;
  for (int i = 0; i < 17; ++i) many.push_back(open("bob", Role::kTechnician));
  EXPECT_EQ(sessions.Of("bob").size(), 16U);
  EXPECT_TRUE(many.front().session->ended) << "the one that was used longest ago";
  EXPECT_FALSE(many[1].session->ended);
  EXPECT_FALSE(anna.session->ended) << "of another account";
}

}  // namespace
}  // namespace plumb::test
