// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include <fstream>

#include "algo/base/message_json.hpp"
#include "tests/support/temp_folder.hpp"
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

class FilesTest : public ApiTest {
 protected:
  void SetUp() override {
    ApiTest::SetUp();
    std::filesystem::create_directories(folder_ / "scan/result");
    std::ofstream(folder_ / "scan/result/result.json") << R"({"format": 1})";
    std::ofstream(folder_ / "secret") << "secret";
    std::filesystem::create_symlink(folder_ / "secret", folder_ / "scan/result/overlay.png");
    std::filesystem::create_directories(folder_ / "scan/result/error_map.png");
    loop_->Do([&] {
      Scan scan;
      scan.id = "s1";
      scan.outcome = ScanOutcome::kDone;
      scan.folder = folder_ / "scan";
      service_.scans.push_back(scan);
    });
  }
  plumb::testing::TempFolder folder_;
};

TEST_F(FilesTest, ResultsAreDownloadedUnderASafeName) {
  HttpClient client = LoggedIn("technician");
  EXPECT_EQ(client.Get("/api/v1/results/s1").body, R"({"format": 1})");
  const HttpAnswer file = client.Get("/api/v1/scans/s1/files/result.json?download");
  EXPECT_EQ(file.body, R"({"format": 1})");
  EXPECT_EQ(file.Header("content-disposition"), "attachment; filename=\"s1_result.json\"");
  EXPECT_EQ(file.Header("cache-control"), "no-store");
}

TEST_F(FilesTest, APictureIsDrawnInTheLanguageThatIsAskedFor) {
  HttpClient client = LoggedIn("technician");
  const std::string code(Catalogues().back()->code);
  const std::string files = "/api/v1/scans/s1/files/";
  EXPECT_EQ(client.Get(files + "overlay.png?language=" + code).status, 404)
      << "it cannot be drawn, and the stored one is a link";
  loop_->Do([&] { service_.draws_pictures = true; });
  const HttpAnswer overlay = client.Get(files + "overlay.png?download&language=" + code);
  EXPECT_EQ(overlay.body, "overlay in " + std::string(Catalogues().back()->name));
  EXPECT_EQ(overlay.Header("content-type"), "image/png");
  EXPECT_EQ(overlay.Header("content-disposition"), "attachment; filename=\"s1_overlay.png\"");
  const HttpAnswer map = client.Get(files + "error_map.png?language=en");
  EXPECT_EQ(map.body, "error map in English");
  EXPECT_EQ(map.Header("content-disposition"), "");
  EXPECT_EQ(client.Get(files + "overlay.png?language=xx").status, 400);
  EXPECT_EQ(client.Get(files + "overlay.png").status, 404) << "without a language the stored one";
  EXPECT_EQ(client.Get(files + "result.json?language=" + code).body, R"({"format": 1})");
}

TEST_F(FilesTest, NoPathLeadsOutOfAScan) {
  HttpClient client = LoggedIn("technician");
  for (const char* path :
       {"/api/v1/scans/s1/files/../../secret", "/api/v1/scans/s1/files/..%2f..%2fsecret",
        "/api/v1/scans/s1/files/..", "/api/v1/scans/s1/files/secret",
        "/api/v1/scans/../scans/s1/files/result.json", "/api/v1/scans/s1/files//etc/passwd",
        "/assets/../../etc/passwd", "/assets/..%2f..%2fetc%2fpasswd", "/%2e%2e/etc/passwd",
        "/api/v1/scans/s1/files/result.json%00.png"}) {
    EXPECT_EQ(client.Get(path).status, 404) << path;
  }
  EXPECT_EQ(client.Get("/api/v1/scans/s1/files/overlay.png").status, 404) << "a link";
  EXPECT_EQ(client.Get("/api/v1/scans/s1/files/error_map.png").status, 404) << "a folder";
}

TEST_F(FilesTest, DiagnosticsAreSentOnceAndRemoved) {
  std::ofstream(folder_ / "bundle.tar") << "bundle";
  loop_->Do([&] { service_.diagnostics_file = folder_ / "bundle.tar"; });
  HttpClient engineer = LoggedIn("engineer");
  const HttpAnswer answer = engineer.Post("/api/v1/diagnostics");
  EXPECT_EQ(answer.body, "bundle");
  EXPECT_THAT(answer.Header("content-disposition"), HasSubstr("plumb-diagnostics.tar"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "bundle.tar"));
}

class UploadTest : public WebTest {
 protected:
  UploadTest() {
    Start([this](web::HttpServerOptions& options) {
      options.upload_folder = folder_ / "updates";
      options.max_upload_bytes = 1 << 20;
    });
    SetUpAccounts();
  }
  std::string Head(const HttpClient& client, const std::string& name, std::size_t bytes) {
    return "POST /api/v1/update/bundles/" + name +
           " HTTP/1.1\r\nHost: localhost\r\nCookie: " + client.cookie +
           "\r\nX-CSRF-Token: " + client.csrf_token +
           "\r\nContent-Type: application/octet-stream\r\nContent-Length: " +
           std::to_string(bytes) + "\r\n\r\n";
  }
  HttpAnswer Send(const HttpClient& client, const std::string& name, const std::string& body) {
    HttpConnection connection(port_);
    connection.Send(Head(client, name, body.size()));
    connection.Send(body);
    return connection.Read();
  }
  [[nodiscard]] std::size_t FilesLeft() const {
    std::size_t count = 0;
    std::error_code error;
    for (std::filesystem::directory_iterator entry(folder_ / "updates", error), end;
         !error && entry != end; ++entry)
      ++count;
    return count;
  }

  /// A file goes when its request is over, which is after its answer.
  [[nodiscard]] bool BecomesEmpty() const {
    for (int i = 0; i < 10000 && FilesLeft() > 0; ++i) ::usleep(1000);
    return FilesLeft() == 0;
  }

  testing::TempFolder folder_;
};

TEST_F(UploadTest, ABundleGoesToTheDiskAndNothingIsLeftOfIt) {
  const HttpClient engineer = LoggedIn("engineer");
  const std::string bundle = "hsqs" + std::string(900000, 'x');
  EXPECT_EQ(Send(engineer, "plumb-2.raucb", bundle).status, 200);
  loop_->Do([&] {
    EXPECT_EQ(service_.uploaded_bytes, bundle.size());
    EXPECT_THAT(service_.update.bundles, ::testing::Contains("plumb-2.raucb"));
  });
  EXPECT_TRUE(BecomesEmpty()) << "the fake keeps none";
  HttpClient again = LoggedIn("engineer");
  EXPECT_EQ(again.Ask("DELETE", "/api/v1/update/bundles/plumb-2.raucb", "").status, 200);
  EXPECT_EQ(again.Ask("DELETE", "/api/v1/update/bundles/plumb-2.raucb", "").status, 404);
}

TEST_F(UploadTest, APlanningCtReachesTheServiceWithItsChoicesAndNothingIsLeftOfIt) {
  Patient patient;
  patient.id = "p1";
  service_.patients.push_back(patient);
  HttpClient physicist = LoggedIn("physicist");
  physicist.extra_headers["Content-Type"] = "application/octet-stream";
  const std::string path = "/api/v1/patients/p1/planning";
  physicist.extra_headers["X-Plumb-Planning"] =
      "structures_bytes=6&roi=BODY+S%C3%A9&isocentre_of=AP";
  const HttpAnswer answer = physicist.Ask("POST", path, "structplan");
  EXPECT_EQ(answer.status, 201) << answer.body;
  loop_->Do([&] {
    EXPECT_EQ(service_.uploaded_bytes, 10U);
    EXPECT_EQ(service_.sent_planning.structures_bytes, 6U);
    EXPECT_EQ(service_.sent_planning.roi, "BODY S\xC3\xA9");
    EXPECT_EQ(service_.sent_planning.beam, "AP");
    EXPECT_EQ(service_.references.back().id, answer.json()["id"]);
  });
  EXPECT_TRUE(BecomesEmpty()) << "it names the patient";
  physicist.extra_headers["X-Plumb-Planning"] =
      "structures_bytes=0&plan_bytes=4&threshold_hu=-300.5";
  EXPECT_EQ(physicist.Ask("POST", path, "planimages").status, 201);
  loop_->Do([&] {
    EXPECT_EQ(service_.sent_planning.plan_bytes, 4U);
    EXPECT_EQ(service_.sent_planning.threshold_hu, -300.5);
  });
  for (const std::string& bad :
       {std::string("structures_bytes=-1"), std::string("%GG"), std::string("structures_bytes=0"),
        "structures_bytes=1&roi=" + std::string(257, 'x'),
        std::string("structures_bytes=1&threshold_hu=-300"),
        std::string("structures_bytes=1&threshold_hu=-300&plan_bytes=0"),
        std::string("structures_bytes=1&threshold_hu=0.1&plan_bytes=1"),
        std::string("structures_bytes=1&threshold_hu=-900.1&plan_bytes=1"),
        std::string("structures_bytes=1&threshold_hu=nan&plan_bytes=1")}) {
    physicist.extra_headers["X-Plumb-Planning"] = bad;
    EXPECT_EQ(physicist.Ask("POST", path, "x").status, 400) << bad;
  }
  physicist.extra_headers["X-Plumb-Planning"] = "structures_bytes=1";
  EXPECT_EQ(physicist.Ask("POST", "/api/v1/patients/p9/planning", "x").status, 404);
}

TEST_F(UploadTest, WhatIsNoBundleOrTooLargeIsRefused) {
  const HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(Send(engineer, "zip.raucb", "PK" + std::string(5000, 'x')).status, 400);
  EXPECT_EQ(Send(engineer, "name.zip", "hsqs" + std::string(5000, 'x')).status, 400);
  EXPECT_EQ(Send(engineer, "a.raucb", "").status, 411);
  HttpConnection large(port_);
  large.Send(Head(engineer, "large.raucb", std::size_t{2} << 20));
  EXPECT_EQ(large.Read().status, 413);
  EXPECT_TRUE(BecomesEmpty());
}

TEST_F(UploadTest, ABrokenUploadLeavesNothing) {
  const HttpClient engineer = LoggedIn("engineer");
  {
    HttpConnection broken(port_);
    broken.Send(Head(engineer, "broken.raucb", 500000));
    broken.Send("hsqs" + std::string(100000, 'x'));
    bool begun = false;
    for (int i = 0; i < 2000 && !begun; ++i) begun = FilesLeft() == 1, ::usleep(1000);
    EXPECT_TRUE(begun);
    EXPECT_EQ(Send(engineer, "second.raucb", "hsqs" + std::string(5000, 'x')).status, 409)
        << "one at a time";
  }
  EXPECT_TRUE(BecomesEmpty());
  EXPECT_EQ(Send(engineer, "third.raucb", "hsqs" + std::string(5000, 'x')).status, 200);
}

TEST_F(UploadTest, OnlyAnEngineerSendsBundles) {
  for (const char* name : {"technician", "physicist"})
    EXPECT_EQ(Send(LoggedIn(name), "a.raucb", "hsqs" + std::string(5000, 'x')).status, 403);
  HttpClient logged_out(port_);
  EXPECT_EQ(Send(logged_out, "a.raucb", "hsqs" + std::string(5000, 'x')).status, 401);
  EXPECT_TRUE(BecomesEmpty());
}

TEST_F(ApiTest, WithoutAFolderNoFilesAreTaken) {
  const HttpClient engineer = LoggedIn("engineer");
  HttpConnection connection(port_);
  connection.Send("POST /api/v1/update/bundles/a.raucb HTTP/1.1\r\nHost: localhost\r\nCookie: " +
                  engineer.cookie + "\r\nX-CSRF-Token: " + engineer.csrf_token +
                  "\r\nContent-Type: application/octet-stream\r\nContent-Length: 5\r\n\r\nhsqs!");
  EXPECT_EQ(connection.Read().status, 409);
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
