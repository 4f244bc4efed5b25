// SPDX-License-Identifier: Apache-2.0
#include "tests/support/api_rules.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "tests/support/http_client.hpp"

namespace plumb::test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class ApiRules : public ::testing::Test {
 protected:
  void SetUp() override {
    HttpClient engineer(appliance_->port());
    ASSERT_EQ(engineer
                  .Post("/api/v1/setup", {{"code", appliance_->setup_code()},
                                          {"name", "engineer"},
                                          {"password", kPassword}})
                  .status,
              200);
    engineer.FetchToken();
    for (const auto& [name, role] : {std::pair{"technician", "technician"},
                                     {"physicist", "physicist"},
                                     {"second", "physicist"}})
      ASSERT_TRUE(AddAccount(appliance_->port(), engineer, name, role)) << name;
  }

  [[nodiscard]] HttpClient LoggedIn(const std::string& name) const {
    HttpClient client(appliance_->port());
    EXPECT_EQ(client.LogIn(name, kPassword), 200) << name;
    return client;
  }
  static std::string AddPatient(HttpClient& client, const std::string& code) {
    return client.Post("/api/v1/patients", {{"code", code}, {"site", "thorax"}})
        .json()
        .value("id", "");
  }
  static HttpAnswer Open(HttpClient& client, const std::string& patient, const std::string& purpose,
                         const std::string& replaces = "") {
    return client.Post("/api/v1/patients/" + patient + "/open",
                       {{"purpose", purpose}, {"reason", ""}, {"replaces", replaces}});
  }
  static json Plan(int revision = 1) {
    return {{"revision", revision},
            {"region_m", {{0.0, 0.0}, {0.5, 0.0}, {0.5, 0.4}}},
            {"isocentre_m", {0.2, 0.1, 0.05}},
            {"shift_tolerance_mm", 2.5},
            {"rotation_tolerance_deg", 1.5},
            {"posture", "FFP"},
            {"couch_markers", true}};
  }
  /// Made of a scan just now by the first physicist, not yet planned.
  std::string Draft(HttpClient& physicist, const std::string& patient) const {
    return physicist
        .Post("/api/v1/references",
              {{"scan_id", appliance_->StoreScan(patient)}, {"reason", "planning"}})
        .json()
        .value("id", "");
  }

  /// Signs what is stored now.
  static HttpAnswer Approve(HttpClient& who, const std::string& path,
                            const std::string& password = kPassword) {
    const json seen = who.Get(path).json();
    return who.Post(
        path + "/approve",
        {{"revision", seen["revision"]}, {"digest", seen["digest"]}, {"password", password}});
  }

  std::unique_ptr<RuledAppliance> appliance_ = MakeRuledAppliance();
};

TEST_F(ApiRules, CodesDifferByMoreThanCase) {
  HttpClient technician = LoggedIn("technician");
  EXPECT_NE(AddPatient(technician, "PX-17"), "");
  EXPECT_EQ(technician.Post("/api/v1/patients", {{"code", "px-17"}, {"site", ""}}).status, 409);
  EXPECT_EQ(technician.Post("/api/v1/patients", {{"code", "Px1-7"}, {"site", ""}}).status, 409)
      << "hyphens do not matter";
  EXPECT_EQ(technician.Post("/api/v1/patients", {{"code", "PX-18"}, {"site", ""}}).status, 201);
  EXPECT_EQ(technician.Get("/api/v1/patients").json()["patients"].size(), 2U);
}

TEST_F(ApiRules, SiteAndNoteAreBoundedAndArchivingIsThePhysicists) {
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  const std::string id =
      technician.Post("/api/v1/patients", {{"code", "P-77"}, {"site", ""}}).json()["id"];
  const std::string path = "/api/v1/patients/" + id;
  EXPECT_EQ(technician.Put(path, {{"site", "pelvis"}, {"note", std::string(500, 'n')}}).status,
            200);
  EXPECT_EQ(technician.Put(path, {{"site", "pelvis"}, {"note", std::string(501, 'n')}}).status,
            400);
  EXPECT_EQ(technician.Put(path, {{"site", std::string(65, 's')}, {"note", ""}}).status, 400);
  EXPECT_EQ(technician.Put(path, {{"site", "pelvis"}}).status, 400) << "both, or neither is known";
  const nlohmann::json patient = technician.Get(path).json();
  EXPECT_EQ(patient["site"], "pelvis");
  EXPECT_EQ(patient["note"], std::string(500, 'n'));
  EXPECT_EQ(patient["archived"], false);
  EXPECT_EQ(technician.Post(path + "/archive", {{"archived", true}}).status, 403);
  EXPECT_EQ(physicist.Post(path + "/archive", {{"archived", "yes"}}).status, 400);
  EXPECT_EQ(physicist.Post(path + "/archive", {{"archived", true}}).status, 200);
  EXPECT_EQ(technician.Get(path).json()["archived"], true);
  EXPECT_EQ(technician.Post(path + "/open", {{"purpose", "reference"}, {"reason", ""}}).status,
            409);
  EXPECT_EQ(physicist.Post(path + "/archive", {{"archived", false}}).status, 200);
}

TEST_F(ApiRules, TemplatesArePhysicistsAndBounded) {
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  nlohmann::json wanted = {{"site", "thorax"},
                           {"width_mm", 300},
                           {"height_mm", 400},
                           {"shift_tolerance_mm", 5},
                           {"rotation_tolerance_deg", 2}};
  EXPECT_EQ(technician.Put("/api/v1/templates", wanted).status, 403);
  EXPECT_EQ(physicist.Put("/api/v1/templates", wanted).status, 200);
  const nlohmann::json kept = technician.Get("/api/v1/templates").json()["templates"];
  ASSERT_EQ(kept.size(), 1U);
  EXPECT_EQ(kept[0]["height_mm"], 400);
  EXPECT_EQ(kept[0]["tolerance"]["shift_mm"], 5);
  EXPECT_EQ(kept[0]["changed_by"], "physicist");
  for (const auto& [field, value] :
       std::map<std::string, nlohmann::json>{{"width_mm", 19.9},
                                             {"height_mm", 3001},
                                             {"shift_tolerance_mm", 0},
                                             {"rotation_tolerance_deg", 21},
                                             {"site", ""}}) {
    nlohmann::json wrong = wanted;
    wrong[field] = value;
    EXPECT_EQ(physicist.Put("/api/v1/templates", wrong).status, 400) << field;
  }
  EXPECT_EQ(physicist.Post("/api/v1/templates/remove", {{"site", "pelvis"}}).status, 404);
  EXPECT_EQ(physicist.Post("/api/v1/templates/remove", {{"site", "thorax"}}).status, 200);
  EXPECT_TRUE(technician.Get("/api/v1/templates").json()["templates"].empty());
}

TEST_F(ApiRules, OneSessionIsOpenAtATimeAndIsNamed) {
  appliance_->PassDailyCheck("technician");
  HttpClient technician = LoggedIn("technician");
  const std::string a = AddPatient(technician, "A"), b = AddPatient(technician, "B");
  EXPECT_EQ(Open(technician, "none", "reference").status, 404);
  EXPECT_EQ(Open(technician, a, "fraction").status, 409) << "no approved reference";
  EXPECT_EQ(Open(technician, a, "reference").status, 200);
  const std::string session =
      technician.Get("/api/v1/status").json()["session"].value("id", std::string());
  ASSERT_NE(session, "");
  const HttpAnswer other = Open(technician, b, "reference");
  EXPECT_EQ(other.status, 409);
  EXPECT_THAT(other.body, HasSubstr("session of A is open (opened by technician)"));
  EXPECT_EQ(Open(technician, b, "reference", "another").status, 409);
  EXPECT_EQ(technician.Post("/api/v1/treatment/close", {{"session_id", "another"}}).status, 409);
  EXPECT_EQ(Open(technician, b, "reference", session).status, 200) << "seen, and replaced";
  const json status = technician.Get("/api/v1/status").json();
  EXPECT_EQ(status["session"]["patient_code"], "B");
  EXPECT_EQ(technician.Post("/api/v1/treatment/close", {{"session_id", session}}).status, 409)
      << "closed already";
  EXPECT_EQ(
      technician.Post("/api/v1/treatment/close", {{"session_id", status["session"]["id"]}}).status,
      200);
  EXPECT_TRUE(technician.Get("/api/v1/status").json()["session"].is_null());
}

TEST_F(ApiRules, WithoutTodaysCheckNothingBecomesAReference) {
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist"),
             second = LoggedIn("second");
  const std::string patient = AddPatient(technician, "PX-17");
  const json wanted = {{"scan_id", appliance_->StoreScan(patient)}, {"reason", "planning"}};
  EXPECT_THAT(Open(technician, patient, "reference").body, HasSubstr("aily check"));
  const HttpAnswer refused = physicist.Post("/api/v1/references", wanted);
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("aily check"));
  appliance_->PassDailyCheck("technician");
  const HttpAnswer made = physicist.Post("/api/v1/references", wanted);
  EXPECT_EQ(made.status, 201) << made.body;
  const std::string path = "/api/v1/references/" + made.json().value("id", "");
  EXPECT_EQ(physicist.Put(path + "/plan", Plan()).status, 200);
  EXPECT_EQ(Approve(second, path).status, 200);
}

TEST_F(ApiRules, AReferenceIsApprovedByASecondPersonAsItWasPlanned) {
  appliance_->PassDailyCheck("technician");
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist"),
             second = LoggedIn("second");
  const std::string patient = AddPatient(technician, "PX-17");
  const std::string id = Draft(physicist, patient), path = "/api/v1/references/" + id;
  EXPECT_TRUE(second.Get(path).json()["planned_by"].is_null());
  const HttpAnswer unplanned = Approve(second, path);
  EXPECT_EQ(unplanned.status, 409);
  EXPECT_THAT(unplanned.body, HasSubstr("nobody has planned"));
  const json shown = second.Get(path).json();
  EXPECT_EQ(physicist.Put(path + "/plan", Plan()).status, 200);
  EXPECT_EQ(technician.Put(path + "/plan", Plan()).status, 403);
  EXPECT_EQ(physicist.Put(path + "/plan", Plan()).status, 409) << "another one was saved since";
  const json planned = second.Get(path).json();
  EXPECT_EQ(planned["revision"], 2);
  const auto sign = [&](const json& revision, const json& digest) {
    return second
        .Post(path + "/approve",
              {{"revision", revision}, {"digest", digest}, {"password", kPassword}})
        .status;
  };
  EXPECT_EQ(sign(1, shown["digest"]), 409) << "what was shown is not what is stored";
  EXPECT_EQ(sign(2, shown["digest"]), 409);
  EXPECT_EQ(second.Post(path + "/approve", {{"revision", 2}, {"password", kPassword}}).status, 400)
      << "it does not say what is signed";
  EXPECT_EQ(second.Post(path + "/approve", {{"revision", 2}, {"digest", planned["digest"]}}).status,
            400)
      << "not signed";
  EXPECT_EQ(Approve(second, path, "not this one").status, 403);
  EXPECT_EQ(Approve(technician, path).status, 403);
  EXPECT_EQ(Approve(physicist, path).status, 403) << "planned it";
  EXPECT_TRUE(
      technician.Get("/api/v1/patients/" + patient).json()["approved_reference_id"].is_null());
  EXPECT_EQ(Approve(second, path).status, 200);
  EXPECT_EQ(Approve(second, path).status, 409) << "approved already";
  const json reference = technician.Get(path).json();
  EXPECT_EQ(reference["approved_by"], "second");
  EXPECT_EQ(reference["planned_by"], "physicist");
  const json& plan = reference["plan"];
  EXPECT_EQ(plan["isocentre_m"], json({0.2, 0.1, 0.05}));
  EXPECT_EQ(plan["region_m"], Plan()["region_m"]);
  EXPECT_EQ(plan["tolerance"]["shift_mm"], 2.5);
  EXPECT_EQ(plan["tolerance"]["rotation_deg"], 1.5);
  EXPECT_EQ(plan["posture"], "FFP");
  EXPECT_EQ(plan["couch_markers"], true);
  EXPECT_EQ(plan["clothing_mm"], 0) << "not stated";
  EXPECT_EQ(plan["ct_breathing_mm"], 0);
  EXPECT_EQ(technician.Get("/api/v1/patients/" + patient).json()["approved_reference_id"], id);
  EXPECT_EQ(Open(technician, patient, "fraction").status, 200);

  // An approved plan is never changed: another plan becomes a separate draft.
  json other = Plan(2);
  other["posture"] = "HFS";
  const HttpAnswer replaced = physicist.Put(path + "/plan", other);
  EXPECT_THAT(replaced.status, ::testing::AnyOf(200, 201)) << replaced.body;
  EXPECT_NE(replaced.json().value("id", id), id);
  EXPECT_EQ(technician.Get(path).json()["plan"]["posture"], "FFP");
  EXPECT_EQ(technician.Get("/api/v1/patients/" + patient).json()["approved_reference_id"], id);
}

TEST_F(ApiRules, AScanIsRemovedForAReasonByWhoMayAndAReferenceIsNot) {
  appliance_->PassDailyCheck("technician");
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  const std::string patient = AddPatient(technician, "PX-17");
  const std::string scan = "/api/v1/scans/" + appliance_->StoreScan(patient);
  const std::string reference = Draft(physicist, patient);
  const std::string of_reference =
      "/api/v1/scans/" +
      physicist.Get("/api/v1/references/" + reference).json().value("scan_id", "");
  const std::string reason = R"({"reason":"blurred"})";
  for (const char* role : {"technician", "engineer"})
    EXPECT_EQ(LoggedIn(role).Ask("DELETE", scan, reason).status, 403) << role;
  EXPECT_EQ(physicist.Ask("DELETE", scan, "{}").status, 400);
  EXPECT_EQ(physicist.Ask("DELETE", scan, R"({"reason":"x"})").status, 400);
  EXPECT_EQ(physicist.Ask("DELETE", of_reference, reason).status, 409);
  EXPECT_EQ(physicist.Ask("DELETE", scan, reason).status, 200);
  EXPECT_EQ(physicist.Ask("DELETE", scan, reason).status, 404);
  EXPECT_EQ(technician.Get(scan + "/files/mesh.ply").status, 404);
  EXPECT_EQ(technician.Get(of_reference).status, 200);
}

TEST_F(ApiRules, WhatGivesNothingToActOnIsNotAccepted) {
  appliance_->PassDailyCheck("technician");
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  const std::string patient = AddPatient(technician, "PX-17");
  const std::string scan = "/api/v1/scans/" + appliance_->StoreScan(patient);
  ASSERT_EQ(Open(technician, patient, "reference").status, 200);
  EXPECT_EQ(technician.Post(scan + "/accept").status, 409) << "compared with nothing";
  EXPECT_EQ(technician
                .Post(scan + "/accept-outside",
                      {{"reason", "the arm cannot be moved"}, {"password", "not this one"}})
                .status,
            403);
  EXPECT_EQ(technician
                .Post(scan + "/accept-outside",
                      {{"reason", "the arm cannot be moved"}, {"password", kPassword}})
                .status,
            409);
  EXPECT_EQ(LoggedIn("engineer").Post(scan + "/accept").status, 403);
  EXPECT_EQ(technician.Post("/api/v1/scans/none/accept").status, 404);
}

TEST_F(ApiRules, ABaselineIsSetByAnotherPersonThanTheOneWhoTookTheCheck) {
  const std::string own = appliance_->PassDailyCheck("physicist");
  HttpClient physicist = LoggedIn("physicist"), second = LoggedIn("second");
  const std::string path = "/api/v1/checks/" + own + "/baseline";
  const json signed_for = {{"reason", "the markers are in place"}, {"password", kPassword}};
  EXPECT_EQ(LoggedIn("technician").Post(path, signed_for).status, 403);
  EXPECT_EQ(physicist.Post(path, signed_for).status, 403);
  EXPECT_EQ(second.Post(path, {{"reason", "x"}, {"password", kPassword}}).status, 400);
  EXPECT_EQ(second.Post(path, {{"password", kPassword}}).status, 400) << "no reason";
  EXPECT_EQ(second.Post(path, {{"reason", "in place"}, {"password", "not this one"}}).status, 403);
  EXPECT_TRUE(physicist.Get("/api/v1/checks").json()["baseline"].is_null());
  EXPECT_EQ(second.Post(path, signed_for).status, 200);
  EXPECT_EQ(physicist.Get("/api/v1/checks").json()["baseline"]["set_by"], "second");
  EXPECT_EQ(second.Post("/api/v1/checks/none/baseline", signed_for).status, 404);
}

TEST_F(ApiRules, SettingsAreKeptAsTheyWereWrittenAndBounded) {
  HttpClient engineer = LoggedIn("engineer");
  const json wanted = {{"shift_tolerance_mm", 2.5}, {"rotation_tolerance_deg", 0.7},
                       {"posture", "HFP"},          {"couch_markers", true},
                       {"auto_stop_s", 7.0},        {"scan_limit_s", 33.0},
                       {"keep_recordings", true},   {"retention_days", 730},
                       {"idle_logout_min", 11},     {"accept_live", "signature"},
                       {"breath_window_mm", 5.0},   {"scan_wristband", true},
                       {"paper", "Letter"},         {"code_check_character", true}};
  ASSERT_NE(engineer.Get("/api/v1/settings").json(), wanted);
  for (const char* role : {"technician", "physicist"})
    EXPECT_EQ(LoggedIn(role).Put("/api/v1/settings", wanted).status, 403) << role;
  EXPECT_EQ(engineer.Put("/api/v1/settings", wanted).status, 200);
  EXPECT_EQ(engineer.Get("/api/v1/settings").json(), wanted);
  for (const auto& [field, value] : std::map<std::string, json>{{"shift_tolerance_mm", 0},
                                                                {"rotation_tolerance_deg", 90.1},
                                                                {"posture", "UPSIDE"},
                                                                {"couch_markers", 1},
                                                                {"auto_stop_s", 0.5},
                                                                {"scan_limit_s", 601},
                                                                {"retention_days", -1},
                                                                {"idle_logout_min", 0},
                                                                {"accept_live", "nobody"},
                                                                {"breath_window_mm", 20.5},
                                                                {"paper", "A3"}}) {
    json wrong = wanted;
    wrong[field] = value;
    const HttpAnswer answer = engineer.Put("/api/v1/settings", wrong);
    EXPECT_EQ(answer.status, 400) << field;
    EXPECT_THAT(answer.body, HasSubstr(field));
    EXPECT_EQ(engineer.Put("/api/v1/settings", {{field, value}}).status, 400) << field;
  }
  EXPECT_EQ(engineer.Get("/api/v1/settings").json(), wanted);
}

TEST_F(ApiRules, ACodeWithAWrongCheckCharacterIsRefusedWhereTheSettingAsksForOne) {
  HttpClient engineer = LoggedIn("engineer"), technician = LoggedIn("technician");
  const auto add = [&](const char* code) {
    return technician.Post("/api/v1/patients", {{"code", code}, {"site", ""}});
  };
  const auto ask = [&](bool asks) {
    EXPECT_EQ(engineer.Put("/api/v1/settings", {{"code_check_character", asks}}).status, 200);
  };
  EXPECT_EQ(add("PX-0042").status, 201) << "the setting is off";
  ask(true);
  for (const char* wrong : {"PX-0043", "PX-0061U", "P0061X", "7"}) {
    const HttpAnswer refused = add(wrong);
    EXPECT_EQ(refused.status, 400) << wrong;
    EXPECT_EQ(refused.json()["error_message"]["id"], "store.patient_code_check") << wrong;
    EXPECT_THAT(refused.body, HasSubstr(wrong));
  }
  EXPECT_EQ(technician.Get("/api/v1/patients").json()["patients"].size(), 1U);
  EXPECT_EQ(add("PX-0042u").status, 201) << "beside one of before";
  ask(false);
  EXPECT_EQ(add("PX-0043").status, 201);
}

TEST_F(ApiRules, ASettingThatIsNotSentStaysAsItIsStored) {
  HttpClient engineer = LoggedIn("engineer");
  json wanted = engineer.Get("/api/v1/settings").json();
  for (const auto& [field, value] : std::map<std::string, json>{{"shift_tolerance_mm", 2.5},
                                                                {"rotation_tolerance_deg", 0.7},
                                                                {"posture", "HFP"},
                                                                {"couch_markers", true},
                                                                {"auto_stop_s", 7.0},
                                                                {"scan_limit_s", 33.0},
                                                                {"keep_recordings", true},
                                                                {"scan_wristband", true},
                                                                {"code_check_character", true},
                                                                {"retention_days", 730},
                                                                {"idle_logout_min", 11},
                                                                {"accept_live", "signature"},
                                                                {"breath_window_mm", 5.0},
                                                                {"paper", "Letter"}}) {
    ASSERT_NE(wanted[field], value) << field;
    wanted[field] = value;
    EXPECT_EQ(engineer.Put("/api/v1/settings", {{field, value}}).status, 200) << field;
    EXPECT_EQ(engineer.Get("/api/v1/settings").json(), wanted) << field;
  }
  EXPECT_EQ(engineer.Put("/api/v1/settings", json::object()).status, 400);
  EXPECT_EQ(engineer.Put("/api/v1/settings", {{"nothing", 1}}).status, 400);
}

TEST_F(ApiRules, ABackupIsMadeByTheEngineerAndIsInTheLog) {
  for (const char* role : {"technician", "physicist"})
    EXPECT_EQ(LoggedIn(role).Post("/api/v1/backup").status, 403) << role;
  HttpClient engineer = LoggedIn("engineer");
  EXPECT_TRUE(engineer.Get("/api/v1/backup").json()["last"].is_null());
  const HttpAnswer made = engineer.Post("/api/v1/backup");
  EXPECT_EQ(made.status, 200) << made.body;
  const json last = engineer.Get("/api/v1/backup").json()["last"];
  ASSERT_TRUE(last.is_object());
  EXPECT_EQ(last["action"], "backup.make");
  EXPECT_EQ(last["user"], "engineer");
}

TEST_F(ApiRules, ANoteThatSomebodyElseHasChangedMeanwhileIsNotReplaced) {
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  const std::string path = "/api/v1/patients/" + AddPatient(technician, "PX-17");
  const std::string site = technician.Get(path).json()["site"];
  const auto save = [&](HttpClient& client, const std::string& note, const std::string& before) {
    return client.Put(
        path, {{"site", site}, {"note", note}, {"site_before", site}, {"note_before", before}});
  };
  EXPECT_EQ(save(physicist, "arms up", "").status, 200);
  const HttpAnswer refused = save(technician, "knee rest", "");
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("changed by somebody else meanwhile"));
  EXPECT_EQ(technician.Get(path).json()["note"], "arms up");
  EXPECT_EQ(save(technician, "arms up, knee rest", "arms up").status, 200);
  EXPECT_EQ(technician.Get(path).json()["note"], "arms up, knee rest");
  EXPECT_EQ(
      technician.Put(path, {{"site", ""}, {"note", ""}, {"note_before", "arms up, knee rest"}})
          .status,
      400)
      << "what was shown is both, or neither";
}

TEST_F(ApiRules, AWipedPatientIsGoneWithEverythingThatBelongsToThem) {
  appliance_->PassDailyCheck("technician");
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  const std::string patient = AddPatient(technician, "PX-17"),
                    other = AddPatient(technician, "PX-18");
  const std::string reference = Draft(physicist, patient), kept = appliance_->StoreScan(other);
  const std::string scan =
      physicist.Get("/api/v1/references/" + reference).json().value("scan_id", "");
  const std::string path = "/api/v1/patients/" + patient;
  const auto wipe = [&](HttpClient& client, const char* password) {
    return client.Ask("DELETE", path, json{{"password", password}}.dump()).status;
  };
  EXPECT_EQ(wipe(technician, kPassword), 403);
  EXPECT_EQ(wipe(physicist, "not this one"), 403);
  EXPECT_EQ(physicist.Get(path).status, 200);
  EXPECT_EQ(wipe(physicist, kPassword), 200);
  EXPECT_EQ(physicist.Get(path).status, 404);
  EXPECT_EQ(physicist.Get("/api/v1/references/" + reference).status, 404);
  EXPECT_EQ(physicist.Get("/api/v1/scans/" + scan).status, 404);
  EXPECT_EQ(physicist.Get("/api/v1/scans/" + kept).status, 200);
}

TEST_F(ApiRules, AccountsAreOfOneNameAndTheLastEngineerStays) {
  HttpClient engineer = LoggedIn("engineer"), technician = LoggedIn("technician");
  const json new_account = {{"name", "technician"},
                            {"role", "physicist"},
                            {"password", kFirstPassword},
                            {"own_password", kPassword}};
  EXPECT_EQ(technician.Post("/api/v1/users", new_account).status, 403);
  EXPECT_EQ(engineer.Post("/api/v1/users", new_account).status, 409);
  EXPECT_EQ(
      engineer.Put("/api/v1/users/engineer", {{"disabled", true}, {"own_password", kPassword}})
          .status,
      409);
  EXPECT_EQ(
      engineer.Put("/api/v1/users/engineer", {{"role", "technician"}, {"own_password", kPassword}})
          .status,
      409);
  EXPECT_EQ(
      engineer.Put("/api/v1/users/none", {{"disabled", true}, {"own_password", kPassword}}).status,
      404);
  EXPECT_EQ(
      engineer.Put("/api/v1/users/technician", {{"disabled", true}, {"own_password", kPassword}})
          .status,
      200);
  EXPECT_EQ(technician.Get("/api/v1/status").status, 401) << "its sessions have ended";
  EXPECT_EQ(technician.LogIn("technician", kPassword), 403);
}

TEST_F(ApiRules, TheRoomsCalibrationIsSignedByWhoMayAsItWasRead) {
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  const auto room = [&] { return technician.Get("/api/v1/room-calibration").json(); };
  const auto sign = [](HttpClient& who, const std::string& digest,
                       const std::string& password = kPassword) {
    return who.Post("/api/v1/room-calibration/sign", {{"digest", digest}, {"password", password}})
        .status;
  };
  EXPECT_EQ(technician.Get("/api/v1/room-calibration/board.pdf").body.substr(0, 5), "%PDF-");
  EXPECT_EQ(room()["versions"].size(), 0U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(room()["scans"].size(), i);
    EXPECT_EQ(sign(physicist, std::string(64, 'a')), 409) << i << " scans";
    appliance_->ScanBoard();
  }
  EXPECT_EQ(room()["why_not_sign"], "");
  EXPECT_EQ(room()["scans"][0]["num_markers"], 4);
  const std::string digest = room()["digest"];
  EXPECT_EQ(sign(technician, digest), 403);
  EXPECT_EQ(sign(physicist, digest, "not this one"), 403);
  EXPECT_EQ(sign(physicist, digest + "0"), 400) << "no digest";
  EXPECT_EQ(sign(physicist, std::string(64, 'b')), 409) << "another one than was read";
  EXPECT_EQ(physicist.Post("/api/v1/room-calibration/sign", {{"digest", digest}}).status, 400);
  EXPECT_EQ(room()["versions"].size(), 0U);
  EXPECT_EQ(sign(physicist, digest), 201);
  EXPECT_EQ(room()["versions"][0]["signed_by"], "physicist");
  EXPECT_EQ(room()["versions"][0]["digest"], digest);
  EXPECT_EQ(sign(physicist, digest), 409) << "its scans are used up";
}

TEST_F(ApiRules, ASensorProfileIsResetAndRolledBackByAnEngineer) {
  HttpClient engineer = LoggedIn("engineer"), physicist = LoggedIn("physicist");
  const auto profile = [&] { return physicist.Get("/api/v1/sensor-profile").json(); };
  const auto file = [&](const std::string& version) {
    return engineer.Get("/api/v1/sensor-profile/" + version + "/file").status;
  };
  const auto post = [](HttpClient& who, const std::string& act, const json& body) {
    return who.Post("/api/v1/sensor-profile/" + act, body).status;
  };
  const auto roll_back = [&](int version, const std::string& password = kPassword) {
    return post(engineer, "roll-back",
                {{"serial", "A"}, {"version", version}, {"password", password}});
  };
  const json reset = {{"serial", "A"}, {"password", kPassword}};
  EXPECT_EQ(profile()["serial"], "A");
  EXPECT_EQ(profile()["versions"].size(), 0U);
  EXPECT_EQ(file("1"), 404);
  appliance_->LearnProfile();
  EXPECT_EQ(profile()["versions"][0]["num_sweeps"], 4);
  EXPECT_EQ(file("1"), 200);
  for (const char* none : {"2", "x", "-1", "99999999999999"}) EXPECT_EQ(file(none), 404) << none;
  EXPECT_EQ(post(physicist, "reset", reset), 403);
  EXPECT_EQ(post(engineer, "reset", {{"serial", "A"}}), 400);
  EXPECT_EQ(post(engineer, "reset", {{"serial", "A"}, {"password", "not this one"}}), 403);
  EXPECT_EQ(post(engineer, "reset", {{"serial", "B"}, {"password", kPassword}}), 409);
  EXPECT_EQ(profile()["versions"].size(), 1U);
  EXPECT_EQ(post(engineer, "reset", reset), 200);
  EXPECT_EQ(profile()["versions"][0]["num_sweeps"], 0);
  EXPECT_EQ(file("2"), 404) << "a reset holds no profile";
  EXPECT_EQ(roll_back(1, "not this one"), 403);
  EXPECT_EQ(roll_back(2), 404);
  EXPECT_EQ(roll_back(0), 400);
  EXPECT_EQ(roll_back(1), 200);
  EXPECT_EQ(profile()["versions"][0]["version"], 3);
  EXPECT_EQ(profile()["versions"][0]["num_sweeps"], 4);
  EXPECT_EQ(profile()["versions"][0]["cause"], "rolled_back");
}

TEST_F(ApiRules, DiagnosticsAreSentToAnEngineerAndNameNoPatient) {
  HttpClient engineer = LoggedIn("engineer"), physicist = LoggedIn("physicist");
  AddPatient(physicist, "PX-4711");
  EXPECT_EQ(physicist.Post("/api/v1/diagnostics").status, 403);
  const HttpAnswer answer = engineer.Post("/api/v1/diagnostics");
  EXPECT_EQ(answer.status, 200);
  EXPECT_THAT(answer.Header("content-disposition"), HasSubstr("plumb-diagnostics.txt"));
  EXPECT_THAT(answer.body, HasSubstr("health: "));
  EXPECT_THAT(answer.body, ::testing::Not(HasSubstr("PX-4711")));
  const json entries = physicist.Get("/api/v1/audit").json()["entries"];
  EXPECT_TRUE(std::any_of(entries.begin(), entries.end(), [](const json& entry) {
    return entry.value("user", "") == "engineer" &&
           entry.value("action", "") == "diagnostics.write";
  }));
}

TEST_F(ApiRules, WhatWasDoneIsInTheLogWithWhoDidIt) {
  appliance_->PassDailyCheck("technician");
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  const std::string patient = AddPatient(technician, "PX-17");
  ASSERT_EQ(Open(technician, patient, "reference").status, 200);
  const std::string session = technician.Get("/api/v1/status").json()["session"].value("id", "");
  const std::string reference = Draft(physicist, patient);
  ASSERT_EQ(physicist.Put("/api/v1/references/" + reference + "/plan", Plan()).status, 200);
  HttpClient second = LoggedIn("second");
  ASSERT_EQ(Approve(second, "/api/v1/references/" + reference).status, 200);
  std::set<std::string> seen;
  const json log = physicist.Get("/api/v1/audit").json();
  for (const json& entry : log["entries"])
    seen.insert(entry.value("user", "") + " " + entry.value("action", "") + " " +
                entry.value("subject", ""));
  EXPECT_THAT(seen,
              ::testing::IsSupersetOf(
                  {"technician patient.add " + patient, "technician session.open " + session,
                   "physicist reference.add " + reference, "physicist reference.plan " + reference,
                   "second reference.approve " + reference}));
}

}  // namespace
}  // namespace plumb::test
