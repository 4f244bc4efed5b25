// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include "algo/base/message_json.hpp"
#include "tests/unit/web/web_fixture.hpp"
#include "words/audit.hpp"
#include "words/room.hpp"
#include "words/scan.hpp"
#include "words/text.hpp"
#include "words/upkeep.hpp"

namespace plumb::test {
namespace {

using ::testing::HasSubstr;

class ApiTest : public WebTest {
 protected:
  void SetUp() override {
    Start();
    SetUpAccounts();
  }

  std::string AddPatient(HttpClient& client, const std::string& code) {
    return client.Post("/api/v1/patients", {{"code", code}, {"site", "thorax"}})
        .json()
        .value("id", "");
  }

  static nlohmann::json Plan(int revision = 1) {
    return {{"revision", revision},
            {"region_m", {{0.0, 0.0}, {0.5, 0.0}, {0.5, 0.4}}},
            {"isocentre_m", {0.2, 0.1, 0.05}},
            {"shift_tolerance_mm", 3},
            {"rotation_tolerance_deg", 1},
            {"posture", "HFS"},
            {"couch_markers", false}};
  }
};

TEST_F(ApiTest, NothingUnderTheApiAnswersWithoutLogin) {
  HttpClient stranger(port_);
  for (const web::Route& route : server_->routes()) {
    if (route.permission == web::Permission::kNone) continue;
    std::string path = route.pattern;
    for (std::size_t at; (at = path.find('{')) != std::string::npos;)
      path.replace(at, path.find('}') - at + 1, "x1");
    EXPECT_EQ(stranger.Ask(route.method, path, route.method == "GET" ? "" : "{}").status, 401)
        << route.Name();
  }
  EXPECT_EQ(stranger.Get("/api/v1/nothing").status, 401);
  EXPECT_EQ(stranger.Get("/health").status, 200);
}

TEST_F(ApiTest, HealthSaysWhyItIsNotWell) {
  loop_->Do([&] {
    service_.health = {false, say::upkeep::StorageUnhealthy(say::upkeep::ReadOnlyDisk())};
  });
  const HttpAnswer answer = HttpClient(port_).Get("/health");
  EXPECT_EQ(answer.status, 503);
  EXPECT_EQ(answer.json()["reason"], "storage: the state folder is on a read-only disk");
  EXPECT_EQ(answer.json()["reason_message"]["arguments"]["why"]["id"], "upkeep.read_only_disk");
}

/// The message beside an English sentence says the same.
void ExpectBeside(const nlohmann::json& json, const std::string& key) {
  ASSERT_TRUE(json.contains(key + "_message")) << key << " in " << json;
  const Message message = MessageFromJson(json[key + "_message"], "");
  EXPECT_EQ(message.English(), json[key]) << json[key + "_message"];
  EXPECT_FALSE(message.Is(say::text::kVerbatim)) << json[key + "_message"];
}

TEST_F(ApiTest, TheOutlineComesWithThePictureToWhichItBelongs) {
  HttpClient technician = LoggedIn("technician");
  const char* const place = "/api/v1/preview/outline";
  EXPECT_EQ(technician.Get(place).status, 404) << "no reference";
  loop_->Do([&] {
    service_.outline = {.jpeg = std::string("\xff\xd8\0\x01", 4),
                        .reference = "R-7",
                        .lines = {{{0.25F, 1.0F / 3}, {0.5F, 1.0F}}, {{0.0F, 0.0F}}},
                        .is_placed = true};
  });
  EXPECT_EQ(technician.Get(place).json(),
            nlohmann::json({{"picture", "/9gAAQ=="},
                            {"reference", "R-7"},
                            {"lines", {{{0.25, 0.3333}, {0.5, 1.0}}, {{0.0, 0.0}}}},
                            {"is_placed", true}}));
  loop_->Do([&] { service_.outline = CameraOutline{.jpeg = "x", .reference = {}, .lines = {}}; });
  const nlohmann::json unplaced = technician.Get(place).json();
  EXPECT_EQ(unplaced["lines"], nlohmann::json::array());
  EXPECT_EQ(unplaced["is_placed"], false);
}

TEST_F(ApiTest, ARefusalIsAMessageBesideItsEnglishSentence) {
  HttpClient technician = LoggedIn("technician");
  for (const HttpAnswer& refused :
       {HttpClient(port_).Get("/api/v1/status"), HttpClient(port_).Get("/nowhere"),
        technician.Post("/api/v1/backup"), technician.Post("/api/v1/press", {{"a", 1}}),
        technician.Get("/api/v1/scans/x1"), technician.Get("/api/v1/scans?limit=many"),
        technician.Post("/api/v1/patients", {{"code", 1}}),
        technician.Post("/api/v1/patients", {{"code", "P 1"}, {"site", ""}}),
        technician.Post("/api/v1/session/password",
                        {{"old_password", kPassword}, {"password", "1234567890"}}),
        HttpClient(port_).Post("/api/v1/login", {{"name", "x"}, {"password", "y"}})}) {
    EXPECT_GE(refused.status, 400) << refused.body;
    ExpectBeside(refused.json(), "error");
  }
  const nlohmann::json range = technician.Get("/api/v1/scans?limit=201").json()["error_message"];
  EXPECT_EQ(range, nlohmann::json({{"id", "web.field_whole_range"},
                                   {"arguments", {{"field", "limit"}, {"most", 200}}}}));
}

TEST_F(ApiTest, TheStatusHasAMessageBesideEachSentence) {
  loop_->Do([&] {
    service_.status.fault = say::upkeep::DiskFull(24, 40);
    service_.status.rolled_back = say::upkeep::RestartNotCarriedOut();
    service_.status.reference_block = say::scan::IsWarmingUp(20);
    service_.status.warnings = {say::room::ConfigurationIgnored(), say::upkeep::PageWithoutTls()};
    service_.status.storage.warnings = {say::upkeep::ScansUnusable(3)};
  });
  HttpClient technician = LoggedIn("technician");
  const nlohmann::json status = technician.Get("/api/v1/status").json();
  for (const char* key : {"fault", "rolled_back", "reference_block"}) ExpectBeside(status, key);
  EXPECT_EQ(status["fault_message"]["arguments"]["free"],
            nlohmann::json({{"value", 24.0}, {"unit", "MB"}}));
  for (const auto& [of, count] : {std::pair{status, 2U}, std::pair{status["storage"], 1U}}) {
    ASSERT_EQ(of["warnings"].size(), count);
    ASSERT_EQ(of["warning_messages"].size(), count);
    for (std::size_t i = 0; i < count; ++i)
      EXPECT_EQ(MessageFromJson(of["warning_messages"][i], "").English(), of["warnings"][i]);
  }
  loop_->Do([&] { service_.status = Status(); });
  const nlohmann::json well = technician.Get("/api/v1/status").json();
  EXPECT_EQ(well["fault"], nullptr);
  EXPECT_EQ(well["fault_message"], nullptr);
  EXPECT_EQ(well["warning_messages"], nlohmann::json::array());
}

TEST_F(ApiTest, ADetailOfTheLogIsAMessageUnlessItIsAPersonsTextOrAnIdentifier) {
  HttpClient physicist = LoggedIn("physicist");
  loop_->Do([&] {
    service_.Log({"anna", "10.0.0.2"}, "system.factory_reset_request", "",
                 say::audit::RecordsKept());
    service_.Log({"anna", "10.0.0.2"}, "scan.remove", "1", Message::Verbatim("blurred"));
  });
  const nlohmann::json entries = physicist.Get("/api/v1/audit?limit=2").json()["entries"];
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(entries[0]["detail"], "blurred");
  EXPECT_EQ(entries[0]["detail_message"], nullptr);
  ExpectBeside(entries[1], "detail");
}

TEST_F(ApiTest, AReportComesInTheLanguageThatIsAskedFor) {
  HttpClient client = LoggedIn("technician");
  const std::string patient = AddPatient(client, "P-1");
  const std::string path = "/api/v1/patients/" + patient + "/report.pdf";
  EXPECT_EQ(client.Get(path + "?language=" + std::string(Catalogues().back()->code)).status, 200);
  loop_->Do([&] { EXPECT_EQ(service_.report_language, Catalogues().back()->code); });
  const HttpAnswer english = client.Get(path);
  EXPECT_EQ(english.status, 200);
  EXPECT_EQ(english.Header("content-disposition"), "attachment; filename=\"plumb_course_P-1.pdf\"")
      << "by the code that people know";
  loop_->Do([&] { EXPECT_EQ(service_.report_language, "en"); });
  const HttpAnswer unknown = client.Get(path + "?language=xx");
  EXPECT_EQ(unknown.status, 400);
  EXPECT_THAT(unknown.body, HasSubstr("expected one of en"));
  EXPECT_EQ(client.Get("/api/v1/scans/x1/report.pdf?language=../etc").status, 400);
}

TEST_F(ApiTest, ChangesNeedTheSessionsToken) {
  HttpClient client = LoggedIn("technician");
  const std::string token = client.csrf_token;
  client.csrf_token.clear();
  EXPECT_EQ(client.Post("/api/v1/press").status, 403);
  client.csrf_token = LoggedIn("physicist").csrf_token;
  EXPECT_EQ(client.Post("/api/v1/press").status, 403);
  EXPECT_TRUE(service_.scans.empty());
  client.csrf_token = token;
  EXPECT_EQ(client.Post("/api/v1/press").status, 200);
  EXPECT_EQ(service_.scans.size(), 1U);
}

TEST_F(ApiTest, ChangesFromOtherSitesAreRefusedEvenWithTheToken) {
  HttpClient client = LoggedIn("technician");
  client.extra_headers = {{"Origin", "http://evil.example"}};
  EXPECT_EQ(client.Post("/api/v1/press").status, 403);
  client.extra_headers = {{"Origin", "null"}};
  EXPECT_EQ(client.Post("/api/v1/press").status, 403);
  client.extra_headers = {{"Sec-Fetch-Site", "cross-site"}};
  EXPECT_EQ(client.Post("/api/v1/press").status, 403);
  client.extra_headers = {{"Origin", "https://127.0.0.1:" + std::to_string(port_)}};
  EXPECT_THAT(client.Post("/api/v1/press").body, HasSubstr("have the proxy use https"));
  client.extra_headers = {{"Origin", "http://127.0.0.1:" + std::to_string(port_)},
                          {"Sec-Fetch-Site", "same-origin"}};
  EXPECT_EQ(client.Post("/api/v1/press").status, 200);
}

TEST_F(ApiTest, ScanGoesFromPressToResultAndIsAudited) {
  HttpClient client = LoggedIn("technician");
  EXPECT_EQ(client.Get("/api/v1/status").json()["state"], "ready");
  EXPECT_EQ(client.Post("/api/v1/press").status, 200);
  EXPECT_EQ(client.Get("/api/v1/status").json()["state"], "scanning");
  EXPECT_EQ(client.Post("/api/v1/cancel").status, 200);
  EXPECT_EQ(client.Post("/api/v1/cancel").status, 409);
  const nlohmann::json entries = LoggedIn("physicist").Get("/api/v1/audit").json()["entries"];
  std::vector<std::string> actions;
  for (const auto& entry : entries)
    actions.push_back(entry["user"].get<std::string>() + " " + entry["action"].get<std::string>());
  EXPECT_THAT(actions, ::testing::IsSupersetOf({"technician login", "technician scan.start",
                                                "technician cancel", "physicist login"}));
}

TEST_F(ApiTest, TheEngineerSeesWhomTheUnitTellsAndSendsATestMessage) {
  HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(engineer.Get("/api/v1/messages").json()["ways"].size(), 0U);
  EXPECT_EQ(engineer.Post("/api/v1/messages/test").status, 400);
  loop_->Do([&] { service_.status.messages = {{.name = "mail", .sent = 2}}; });
  EXPECT_EQ(LoggedIn("physicist").Post("/api/v1/messages/test").status, 403);
  EXPECT_EQ(engineer.Post("/api/v1/messages/test").status, 200);
  nlohmann::json way = engineer.Get("/api/v1/messages").json()["ways"][0];
  EXPECT_EQ(way["name"], "mail");
  EXPECT_EQ(way["sent"], 3);
  EXPECT_TRUE(way["failure"].is_null());
  loop_->Do([&] { service_.status.messages[0].failure = Message::Verbatim("no such host"); });
  const HttpAnswer failed = engineer.Post("/api/v1/messages/test");
  EXPECT_GE(failed.status, 500);
  EXPECT_EQ(failed.json()["error"], "no such host");
  way = engineer.Get("/api/v1/messages").json()["ways"][0];
  EXPECT_EQ(way["failure"], "no such host");
}

TEST_F(ApiTest, ABackupIsMadeByTheEngineerAndWarningsReachTheStatus) {
  EXPECT_EQ(LoggedIn("technician").Post("/api/v1/backup").status, 403);
  EXPECT_EQ(LoggedIn("physicist").Post("/api/v1/backup").status, 403);
  EXPECT_EQ(LoggedIn("engineer").Post("/api/v1/backup").status, 200);
  loop_->Do(
      [&] { service_.status.storage.warnings = {Message::Verbatim("The disk is 83 % full.")}; });
  EXPECT_EQ(LoggedIn("technician").Get("/api/v1/status").json()["storage"]["warnings"][0],
            "The disk is 83 % full.");
}

TEST_F(ApiTest, TheDailyCheckIsOpenedScannedAndBecomesABaseline) {
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  EXPECT_TRUE(technician.Get("/api/v1/status").json()["check_overdue"]);
  EXPECT_EQ(technician.Post("/api/v1/checks/open").status, 200);
  EXPECT_EQ(technician.Get("/api/v1/status").json()["next_purpose"], "daily_check");
  const auto scan = [&] {
    EXPECT_EQ(technician.Post("/api/v1/press").status, 200);
    EXPECT_EQ(technician.Post("/api/v1/checks/open").status, 409) << "not during a scan";
    EXPECT_EQ(technician.Post("/api/v1/checks/leave").status, 409) << "not during a scan";
    loop_->Do([&] {
      for (int i = 0; i < 20; ++i)
        service_.Tick(std::chrono::steady_clock::now() + std::chrono::seconds(10 * i));
    });
  };
  scan();
  EXPECT_TRUE(service_.scans.empty()) << "a check is not a scan of a patient";
  const nlohmann::json first = technician.Get("/api/v1/checks").json();
  ASSERT_EQ(first["checks"].size(), 1U);
  EXPECT_EQ(first["checks"][0]["status"], "no_baseline");
  EXPECT_EQ(first["checks"][0]["user"], "technician");
  EXPECT_EQ(first["checks"][0]["items"][1]["name"], "misfit");
  EXPECT_EQ(first["baseline"], nullptr);
  const std::string baseline =
      "/api/v1/checks/" + first["checks"][0]["id"].get<std::string>() + "/baseline";
  const nlohmann::json reason = {{"reason", "first of this room"}, {"password", kPassword}};
  EXPECT_EQ(technician.Post(baseline, reason).status, 403);
  EXPECT_EQ(physicist.Post(baseline, reason).status, 200);
  EXPECT_EQ(physicist.Post("/api/v1/checks/none/baseline", reason).status, 404);
  EXPECT_EQ(technician.Post("/api/v1/checks/open").status, 200);
  scan();
  const nlohmann::json status = technician.Get("/api/v1/status").json();
  EXPECT_EQ(status["last_check"]["status"], "passed");
  EXPECT_FALSE(status["check_overdue"]);
  EXPECT_EQ(technician.Get("/api/v1/checks").json()["baseline"]["set_by"], "physicist");
  EXPECT_EQ(HttpClient(port_).Get("/api/v1/checks").status, 401);
}

TEST_F(ApiTest, ADailyCheckThatWasOpenedIsLeft) {
  HttpClient technician = LoggedIn("technician");
  EXPECT_EQ(technician.Post("/api/v1/checks/leave").status, 409) << "none is open";
  EXPECT_EQ(technician.Post("/api/v1/checks/open").status, 200);
  EXPECT_EQ(technician.Post("/api/v1/checks/leave").status, 200);
  EXPECT_NE(technician.Get("/api/v1/status").json()["next_purpose"], "daily_check");
  EXPECT_EQ(technician.Post("/api/v1/checks/leave").status, 409);
}

TEST_F(ApiTest, AReferenceStatesWhereTheRoomLiesOnItsOwnMaps) {
  HttpClient physicist = LoggedIn("physicist");
  Reference reference;
  reference.id = "r7";
  loop_->Do([&] {
    service_.references.push_back(reference);
    service_.room_of_references = RoomOnMap{{-1, 0}, {0, 1}, true};
  });
  const nlohmann::json turned = {
      {"gantry_xy", {-1.0, 0.0}}, {"right_xy", {0.0, 1.0}}, {"known", true}};
  EXPECT_EQ(physicist.Get("/api/v1/references/r7").json()["room"], turned);
  EXPECT_NE(physicist.Get("/api/v1/status").json()["room"], turned);
  loop_->Do([&] { service_.room_of_references->lasers_m = {0.5, 0.25, 0.125}; });
  EXPECT_EQ(physicist.Get("/api/v1/references/r7").json()["room"]["lasers_m"],
            nlohmann::json({0.5, 0.25, 0.125}));
  EXPECT_EQ(physicist.Get("/api/v1/references/r8").status, 404);
}

TEST_F(ApiTest, PlansOutOfRangeAreRefusedWithTheField) {
  HttpClient physicist = LoggedIn("physicist");
  const auto refused = [&](const std::string& field, const nlohmann::json& value) {
    nlohmann::json plan = Plan();
    plan[field] = value;
    const HttpAnswer answer = physicist.Put("/api/v1/references/r1/plan", plan);
    EXPECT_EQ(answer.status, 400) << field << " = " << value;
    EXPECT_THAT(answer.body, HasSubstr(field));
  };
  refused("shift_tolerance_mm", 0);
  refused("shift_tolerance_mm", "3");
  refused("rotation_tolerance_deg", 1e300);
  refused("posture", "UPSIDE");
  refused("couch_markers", 1);
  refused("region_m", {{0, 0}, {1, 1}});
  refused("region_m", {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}});
  refused("region_m", std::vector<std::array<double, 2>>(501, {0.0, 0.0}));
  refused("isocentre_m", {1, 2});
  for (const char* stated : {"clothing_mm", "ct_breathing_mm"}) {
    for (const nlohmann::json& wrong :
         {nlohmann::json(-0.1), nlohmann::json(30.1), nlohmann::json("5"), nlohmann::json(nullptr)})
      refused(stated, wrong);
  }
  nlohmann::json crossing = Plan();
  crossing["region_m"] = {{0, 0}, {1, 1}, {1, 0}, {0, 1}};
  const HttpAnswer answer = physicist.Put("/api/v1/references/r1/plan", crossing);
  EXPECT_EQ(answer.status, 400);
  EXPECT_THAT(answer.body, HasSubstr("crosses itself"));
}

TEST_F(ApiTest, BodiesMustBeSmallShallowWholeJsonInUtf8) {
  HttpClient client = LoggedIn("technician");
  const auto status = [&](const std::string& body) {
    return client.Ask("POST", "/api/v1/patients", body).status;
  };
  EXPECT_EQ(status("{\"code\": \"A\""), 400);
  EXPECT_EQ(status("[]"), 400);
  EXPECT_EQ(status("null"), 400);
  EXPECT_EQ(status(R"({"code":"A","site":"x","more":1})"), 400);
  EXPECT_EQ(status("{\"code\":\"A\",\"site\":\"\xC3\x28\"}"), 400);
  EXPECT_EQ(status(R"({"code":"A","site":"\u0000"})"), 400);
  EXPECT_EQ(status(R"({"code":"../../etc","site":"x"})"), 400);
  EXPECT_EQ(status(std::string(60000, '[')), 400);
  EXPECT_EQ(status(std::string(70000, ' ')), 413);
  client.extra_headers["Content-Type"] = "text/plain";
  EXPECT_EQ(status(R"({"code":"A","site":"x"})"), 415);
  EXPECT_TRUE(service_.patients.empty());
}

TEST_F(ApiTest, WrongMethodsNameTheRightOnes) {
  HttpClient client = LoggedIn("technician");
  const HttpAnswer answer = client.Ask("PUT", "/api/v1/patients", "{}");
  EXPECT_EQ(answer.status, 405);
  EXPECT_EQ(answer.Header("allow"), "GET, POST");
  EXPECT_EQ(client.Ask("TRACE", "/api/v1/status", "").status, 405);
  EXPECT_EQ(client.Ask("HEAD", "/api/v1/status", "").status, 200);
}

TEST_F(ApiTest, SlowCompletionsAreWaitedForAndLateOnesFindNobody) {
  HttpClient client = LoggedIn("technician");
  loop_->Do([&] { service_.hold_completions = true; });
  std::jthread asking([&] { EXPECT_EQ(client.Post("/api/v1/press").status, 200); });
  bool held = false;
  while (!held) loop_->Do([&] { held = !service_.held.empty(); });
  loop_->Do([&] {
    service_.held.front()();
    service_.held.clear();
  });
  asking.join();
  {
    HttpConnection gone(port_);
    gone.Send("POST /api/v1/cancel HTTP/1.1\r\nHost: localhost\r\nCookie: " + client.cookie +
              "\r\nX-CSRF-Token: " + client.csrf_token + "\r\nContent-Length: 0\r\n\r\n");
    held = false;
    while (!held) loop_->Do([&] { held = !service_.held.empty(); });
  }
  loop_.reset();
  server_.reset();  // with a request that waits
  service_.held.front()();
}

}  // namespace
}  // namespace plumb::test
