// SPDX-License-Identifier: Apache-2.0
// What is changed only with the user's own password, and which passwords are taken.
#include <gmock/gmock.h>

#include <tuple>

#include "tests/unit/web/web_fixture.hpp"
#include "web/security/password_rules.hpp"

namespace plumb::test {
namespace {

using ::testing::HasSubstr;

constexpr const char* kWrong = "not this one at all";

class SignedChangesTest : public WebTest {
 protected:
  void SetUp() override {
    Start();
    SetUpAccounts();
  }
};

TEST_F(SignedChangesTest, TheMachineIsRestartedForAnEngineerWithThePassword) {
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

TEST_F(SignedChangesTest, AFactoryResetIsForAnEngineerWithThePassword) {
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

TEST_F(SignedChangesTest, TheRoomsCalibrationIsSignedByAPhysicistOrAnEngineerWithThePassword) {
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

TEST_F(SignedChangesTest, ASensorProfileIsSeenByAllAndChangedByAnEngineerWithThePassword) {
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

TEST_F(SignedChangesTest, ARollBackIsShownUntilAnEngineerHasSeenIt) {
  service_.status.rolled_back = service_.update.rolled_back =
      Message::Verbatim("version 2 was installed, but");
  HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(engineer.Get("/api/v1/status").json()["rolled_back"], "version 2 was installed, but");
  EXPECT_EQ(engineer.Get("/api/v1/update").json()["rolled_back"], "version 2 was installed, but");
  EXPECT_EQ(engineer.Post("/api/v1/update/seen").status, 200);
  EXPECT_EQ(engineer.Get("/api/v1/status").json()["rolled_back"], nullptr);
}

TEST_F(SignedChangesTest, WhoWasGivenAPasswordChangesItBeforeAnythingElse) {
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
TEST_F(SignedChangesTest, AnOpenSessionWithoutThePasswordChangesNoAccountAndPairsNoScreen) {
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

TEST_F(SignedChangesTest, ThePasswordOfOnesOwnIsChangedWithTheOldOneAlone) {
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

TEST_F(SignedChangesTest, CommonPasswordsAreRefusedWhereverOneIsSet) {
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
  EXPECT_TRUE(web::WhyNotPassword("7392 8841-2290", "40717").empty()) << "a staff number";
  EXPECT_FALSE(web::WhyNotPassword("4071740717", "40717").empty());
  EXPECT_FALSE(web::WhyNotPassword("ninebytes", "x").empty());
  EXPECT_TRUE(web::WhyNotPassword("ten bytes!", "x").empty());
  EXPECT_TRUE(web::WhyNotPassword("ab" + std::string(125, 'x') + "c", "x").empty());
  EXPECT_FALSE(web::WhyNotPassword("ab" + std::string(126, 'x') + "c", "x").empty());
}

}  // namespace
}  // namespace plumb::test
