// SPDX-License-Identifier: Apache-2.0
// The appliance through its page's interface: a real plumbd, real HTTP, the whole workflow of a
// patient.
#include <cstdlib>
#include <fstream>
#include <iterator>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/process.hpp"
#include "tests/support/self_signed.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::HttpAnswer;
using test::HttpClient;
using test::HttpConnection;
using test::kPassword;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using testing::Plumbd;

/// What a person reads in a PDF file.
std::string TextOfPdf(const std::string& bytes, const fs::path& file) {
  std::ofstream(file, std::ios::binary) << bytes;
  const RunResult read = plumb::Run({"/usr/bin/pdftotext", "-layout", file, "-"});
  EXPECT_EQ(read.exit_code, 0) << read.err;
  return read.out;
}

class DaemonWebTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  testing::TempFolder folder_;
};

TEST_F(DaemonWebTest, HealthIsGoodWithAndWithoutASensorAndTellsADamagedDatabase) {
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    plumbd.WaitForState("ready");
    HttpClient stranger(plumbd.port());
    HttpAnswer answer = stranger.Get("/health");
    EXPECT_EQ(answer.status, 200);
    EXPECT_EQ(answer.json(), (json{{"status", "ok"}}));
    plumbd.Sim("unplug");
    plumbd.WaitForState("no_sensor");
    EXPECT_EQ(stranger.Get("/health").status, 200);
    EXPECT_EQ(stranger.Get("/api/v1/status").status, 401);
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  fs::resize_file(folder_ / "state" / "plumb.db", 5000);
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("fault");
  const HttpAnswer answer = HttpClient(plumbd.port()).Get("/health");
  EXPECT_EQ(answer.status, 503);
  EXPECT_THAT(answer.body, HasSubstr("store.database_cut"));
}

TEST_F(DaemonWebTest, FromTheSetupCodeToAnAcceptedFraction) {
  Plumbd plumbd(folder_.path(), {.scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  const std::uint16_t port = plumbd.port();
  ASSERT_NE(plumbd.setup_code(), "") << "the first start prints it";
  HttpClient engineer = plumbd.MakeFirstAccount(), physicist(port), second(port), technician(port);
  ASSERT_EQ(engineer.LogIn("engineer", kPassword), 200);
  for (const auto& [name, role] :
       {std::pair("physicist", "physicist"), std::pair("second", "physicist"),
        std::pair("technician", "technician")}) {
    ASSERT_TRUE(test::AddAccount(port, engineer, name, role)) << name;
  }
  ASSERT_EQ(physicist.LogIn("physicist", kPassword), 200);
  ASSERT_EQ(second.LogIn("second", kPassword), 200);
  ASSERT_EQ(technician.LogIn("technician", kPassword), 200);

  // The demo begins with a session of its own patient, and one is open at a time.
  const json demo = technician.Get("/api/v1/status").json()["session"];
  ASSERT_EQ(technician.Post("/api/v1/treatment/close", {{"session_id", demo["id"]}}).status, 200);
  const std::string patient =
      technician.Post("/api/v1/patients", {{"code", "PX-17"}, {"site", "thorax"}})
          .json()
          .value("id", "");
  ASSERT_NE(patient, "");
  EXPECT_EQ(
      technician
          .Post("/api/v1/patients/" + patient + "/open", {{"purpose", "fraction"}, {"reason", ""}})
          .status,
      409)
      << "no reference yet";
  ASSERT_EQ(technician
                .Post("/api/v1/patients/" + patient + "/open",
                      {{"purpose", "reference"}, {"reason", "planning"}})
                .status,
            200);
  const auto scan = [&](HttpClient& client) {
    EXPECT_EQ(client.Post("/api/v1/scan/start").status, 200);
    EXPECT_EQ(client.Post("/api/v1/scan/start").status, 409) << "a second tap ends nothing";
    plumbd.WaitFor("the end of the sweep", [](const json& s) {
      return s["state"] == "scanning" &&
             s["scan"]["frames"].get<int>() + s["scan"]["frames_dropped"].get<int>() >= 120;
    });
    EXPECT_EQ(client.Get("/api/v1/status").json()["state"], "scanning");
    EXPECT_EQ(client.Get("/api/v1/preview").status, 200);
    EXPECT_EQ(client.Post("/api/v1/scan/end").status, 200);
    EXPECT_EQ(client.Post("/api/v1/scan/end").status, 409);
    return plumbd.WaitForState("result")["last_result"]["scan"].get<std::string>();
  };
  const std::string first = scan(technician);
  EXPECT_EQ(technician.Get("/api/v1/status").json()["light"], "done")
      << "compared with nothing: no word of tolerance";
  EXPECT_EQ(technician.Get("/api/v1/status").json()["next_purpose"], "reference")
      << "the session that is open is for a reference: a second scan is another draft of it";
  const json waiting = technician.Get("/api/v1/status").json()["waiting"];
  ASSERT_EQ(waiting.size(), 1U) << "the scan has made its draft";
  const std::string reference = waiting[0]["reference_id"];
  const json draft = physicist.Get("/api/v1/references/" + reference).json();
  EXPECT_EQ(draft["scan_id"], first);
  json plan = draft["plan"];
  plan["shift_tolerance_mm"] = plan["tolerance"]["shift_mm"];
  plan["rotation_tolerance_deg"] = plan["tolerance"]["rotation_deg"];
  plan.erase("tolerance");
  plan["revision"] = 1;
  ASSERT_EQ(physicist.Put("/api/v1/references/" + reference + "/plan", plan).status, 200);
  const auto approve = [&](HttpClient& who) {
    const json seen = who.Get("/api/v1/references/" + reference).json();
    return who
        .Post("/api/v1/references/" + reference + "/approve", {{"revision", seen["revision"]},
                                                               {"digest", seen["digest"]},
                                                               {"reason", "no check here"},
                                                               {"password", kPassword}})
        .status;
  };
  EXPECT_EQ(approve(physicist), 403) << "not by the person who planned it";
  ASSERT_EQ(approve(second), 200);

  ASSERT_EQ(plumbd.Sim("next-scene")["ok"], true);
  ASSERT_EQ(
      technician
          .Post("/api/v1/patients/" + patient + "/open", {{"purpose", "fraction"}, {"reason", ""}})
          .status,
      200);
  const std::string fraction = scan(technician);
  const json result = technician.Get("/api/v1/results/" + fraction).json();
  EXPECT_EQ(result["verdict"], "move");
  for (const char* picture : {"error_map.png", "overlay.png"}) {
    const std::string path = "/api/v1/scans/" + fraction + "/files/" + picture;
    const HttpAnswer stored = technician.Get(path);
    const HttpAnswer english = technician.Get(path + "?language=en");
    const HttpAnswer spanish = technician.Get(path + "?language=es");
    for (const HttpAnswer* answer : {&stored, &english, &spanish}) {
      EXPECT_EQ(answer->status, 200) << picture;
      EXPECT_TRUE(answer->body.starts_with("\x89PNG")) << picture;
    }
    EXPECT_NE(english.body, stored.body) << "it names the patient's sides";
    EXPECT_NE(spanish.body, english.body) << picture;
  }
  EXPECT_EQ(technician.Post("/api/v1/scans/" + fraction + "/accept").status, 409)
      << "outside tolerance: not in one tap";
  EXPECT_EQ(technician
                .Post("/api/v1/scans/" + fraction + "/accept-outside",
                      {{"reason", "known swelling"}, {"password", "wrong password"}})
                .status,
            403);
  const auto accept = [&] {
    return technician.Post("/api/v1/scans/" + fraction + "/accept-outside",
                           {{"reason", "known swelling"}, {"password", kPassword}});
  };
  const json session = technician.Get("/api/v1/status").json()["session"];
  EXPECT_EQ(technician.Post("/api/v1/treatment/close", {{"session_id", ""}}).status, 200);
  const HttpAnswer closed = accept();
  EXPECT_EQ(closed.status, 409);
  EXPECT_THAT(closed.body, HasSubstr("the session of this scan is not open"));
  ASSERT_EQ(
      technician.Post("/api/v1/treatment/resume", {{"session_id", session["id"]}, {"replaces", ""}})
          .status,
      200);
  EXPECT_EQ(accept().status, 200);
  const json accepted = technician.Get("/api/v1/scans/" + fraction).json();
  EXPECT_EQ(accepted["accepted_reason"], "known swelling");
  EXPECT_EQ(accepted["fraction"], 1);
  const HttpAnswer report = technician.Get("/api/v1/scans/" + fraction + "/report.pdf");
  EXPECT_EQ(report.status, 200);
  const std::string text = TextOfPdf(report.body, folder_.path() / "report.pdf");
  for (const std::string& expected :
       {std::string("PX-17"), std::string("MOVE"), std::string("Longitudinal"),
        std::string("swelling"), std::string("second, 20"), fraction})
    EXPECT_THAT(text, HasSubstr(expected));
  // What a busy machine adds to the warnings takes the picture to a second page.
  EXPECT_THAT(text, ::testing::AnyOf(HasSubstr("Page 1 of 1"), HasSubstr("busy")));
  const HttpAnswer course = technician.Get("/api/v1/patients/" + patient + "/report.pdf");
  EXPECT_THAT(TextOfPdf(course.body, folder_.path() / "course.pdf"), HasSubstr("Course of PX-17"));
  EXPECT_EQ(technician.Get("/api/v1/scans/" + fraction + "/maps/deviation").status, 200);
  EXPECT_EQ(technician.Post("/api/v1/treatment/close", {{"session_id", "another"}}).status, 409)
      << "another session is open by now";
  EXPECT_EQ(technician.Post("/api/v1/treatment/close", {{"session_id", ""}}).status, 200);
  EXPECT_EQ(technician.Get("/api/v1/status").json()["session"], nullptr);

  std::vector<std::string> actions;
  const json audit = physicist.Get("/api/v1/audit").json();
  for (const json& entry : audit["entries"]) {
    actions.push_back(entry["user"].get<std::string>() + " " + entry["action"].get<std::string>());
  }
  EXPECT_THAT(
      actions,
      IsSupersetOf({"engineer user.add", "technician patient.add", "technician scan.start",
                    "technician scan.end", "technician reference.add", "second reference.approve",
                    "technician scan.accept_outside", "technician session.close"}));
  EXPECT_EQ(plumbd.log().find("PX-17"), std::string::npos) << "no patient's code in the log";
  EXPECT_EQ(
      physicist.Ask("DELETE", "/api/v1/patients/" + patient, json{{"password", kPassword}}.dump())
          .status,
      200);
  EXPECT_FALSE(fs::exists(plumbd.state() / "scans" / fraction));
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonWebTest, OffLoopbackItIsServedByTlsWithACertificateOfItsOwnThatStays) {
  std::string certificate;
  for (int start = 0; start < 2; ++start) {
    Plumbd plumbd(folder_.path(), {.listen = "0.0.0.0:0"});
    ASSERT_TRUE(plumbd.WaitUntilUp());
    const json page = plumbd.WaitFor(
        "its page", [](const json& status) { return status["page"]["url"] != ""; })["page"];
    EXPECT_THAT(page["url"].get<std::string>(), ::testing::StartsWith("https://0.0.0.0:"));
    EXPECT_THAT(page["warnings"], ::testing::IsEmpty());
    if (start == 0) certificate = page["certificate"];
    EXPECT_EQ(page["certificate"], certificate) << "the same after a restart";
    EXPECT_THAT(plumbd.log(), HasSubstr("SHA-256 of the page's certificate: " + certificate));
    const fs::path answer = folder_ / "answer";
    const std::string ask =
        "printf 'GET /health HTTP/1.1\\r\\nHost: localhost\\r\\nConnection: "
        "close\\r\\n\\r\\n' | timeout 60 openssl s_client -quiet -connect "
        "127.0.0.1:" +
        std::to_string(plumbd.port()) + " > " + answer.string() + " 2>&1";
    EXPECT_EQ(std::system(ask.c_str()), 0);
    std::ifstream in(answer);
    EXPECT_THAT(std::string(std::istreambuf_iterator<char>(in), {}), HasSubstr("HTTP/1.1 200"));
    HttpConnection plain(plumbd.port());
    plain.Send("GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n");
    EXPECT_EQ(plain.Read().status, 0) << "no answer without TLS";
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  EXPECT_EQ(fs::status(folder_ / "state" / "page-key.pem").permissions(), fs::perms(0600));
  EXPECT_EQ(fs::status(folder_ / "state" / "device.key").permissions(), fs::perms(0600));
  EXPECT_EQ(fs::status(folder_ / "state" / "page-authority.pem").permissions(), fs::perms(0600));
  const RunResult printed = plumb::Run({PLUMB_BINARY, "authority", "--state", folder_ / "state"});
  EXPECT_EQ(printed.exit_code, 0) << printed.err;
  EXPECT_THAT(printed.out, HasSubstr("-----END CERTIFICATE-----"));
  EXPECT_EQ(printed.out.find("PRIVATE"), std::string::npos);
  const RunResult none = plumb::Run({PLUMB_BINARY, "authority", "--state", folder_.path()});
  EXPECT_EQ(none.exit_code, 3);
  EXPECT_THAT(none.err, HasSubstr("holds no authority"));
}

TEST_F(DaemonWebTest, ALargeFileGoesOutInFewTurnsOfTheLoop) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  HttpClient engineer = plumbd.MakeFirstAccount();
  const std::string scan = plumbd.ScanOnce()["last_result"]["scan"];
  const auto turns = [&] { return plumbd.Status()["loop"]["turns"].get<std::size_t>(); };
  const std::size_t before = turns();
  const HttpAnswer mesh = engineer.Get("/api/v1/scans/" + scan + "/files/mesh.ply");
  const std::size_t taken = turns() - before;
  ASSERT_EQ(mesh.status, 200);
  ASSERT_EQ(mesh.body.size(), fs::file_size(folder_ / "state/scans" / scan / "scene/mesh.ply"));
  // The loop's timer ends at most a thousand turns each second.
  constexpr std::size_t kLeastBytesATurn = 50'000;
  EXPECT_LT(taken, 100 + mesh.body.size() / kLeastBytesATurn);
}

TEST_F(DaemonWebTest, AProvisionedDisplaySeesChangesNothingAndStaysRemoved) {
  const std::string key = std::string(60, '0') + "beef";
  std::ofstream(folder_ / "display.key") << key << '\n';
  std::ofstream(folder_ / "plumb-provision.toml")
      << "[display]\nname = \"Room 1\"\nkey_file = \"display.key\"\n";
  fs::create_directory(folder_ / "state");
  const RunResult taken =
      plumb::Run({PLUMBD_BINARY, "--state", folder_ / "state", "--provision",
                  folder_ / "plumb-provision.toml", "--unit", folder_ / "unit"});
  ASSERT_EQ(taken.exit_code, 0) << taken.err;
  const auto claim = [&](HttpClient& client) {
    return client.Post("/api/v1/displays/claim", {{"secret", key}}).status;
  };
  for (const bool is_first : {true, false}) {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    HttpClient display(plumbd.port()), engineer(plumbd.port());
    if (is_first) (void)plumbd.MakeFirstAccount();
    ASSERT_EQ(engineer.LogIn("engineer", kPassword), 200);
    ASSERT_EQ(claim(display), 200);
    display.FetchToken();
    EXPECT_EQ(display.Get("/api/v1/session").json()["role"], "display");
    EXPECT_EQ(display.Get("/api/v1/status").status, 200);
    EXPECT_EQ(display.Post("/api/v1/press").status, 403);
    EXPECT_EQ(display.Get("/api/v1/patients").status, 403);
    const json paired = engineer.Get("/api/v1/displays").json()["displays"];
    ASSERT_EQ(paired.size(), 1U) << "the next start pairs nothing twice";
    EXPECT_EQ(paired[0]["name"], "Room 1");
    if (!is_first) {
      EXPECT_EQ(engineer
                    .Ask("DELETE", "/api/v1/displays/" + paired[0]["id"].get<std::string>(),
                         json{{"password", kPassword}}.dump())
                    .status,
                200);
      EXPECT_EQ(display.Get("/api/v1/status").status, 401);
      EXPECT_EQ(claim(display), 404);
    }
    EXPECT_EQ(plumbd.Stop(), 0);
    EXPECT_THAT(plumbd.log(), ::testing::Not(HasSubstr(key)));
  }
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  HttpClient display(plumbd.port());
  EXPECT_EQ(claim(display), 404) << "what was removed stays removed";
}

TEST_F(DaemonWebTest, TheEndOfItsCertificateIsToldFromThirtyDaysBefore) {
  std::ofstream(folder_ / "plumb.toml")
      << fmt::format("[web]\ntls_certificate = '{}'\ntls_key = '{}'\n",
                     (folder_ / "certificate.pem").string(), (folder_ / "key.pem").string());
  for (const int days : {29, 31}) {
    testing::MakeSelfSigned(folder_ / "certificate.pem", folder_ / "key.pem", "room 1",
                            {.days = days});
    Plumbd plumbd(folder_.path(), {.arguments = {"--config", folder_ / "plumb.toml"}});
    ASSERT_TRUE(plumbd.WaitUntilUp());
    const json page = plumbd.WaitFor(
        "its page", [](const json& status) { return status["page"]["url"] != ""; })["page"];
    EXPECT_EQ(page["certificate"].get<std::string>().size(), 95U);
    ASSERT_EQ(page["warnings"].size(), days == 29 ? 1U : 0U) << page;
    if (days == 29) {
      EXPECT_THAT(page["warnings"][0].get<std::string>(), HasSubstr("CN=room 1 ends on "));
      EXPECT_THAT(plumbd.log(), HasSubstr("CN=room 1 ends on "));
    }
    EXPECT_EQ(plumbd.Stop(), 0);
  }
}

TEST_F(DaemonWebTest, WithoutTlsOffLoopbackOnlyIfItIsSaidAndThenWithAWarning) {
  std::ofstream(folder_ / "plumb.toml") << "[web]\nplain_http = true\n";
  Plumbd plumbd(folder_.path(),
                {.arguments = {"--config", folder_ / "plumb.toml"}, .listen = "0.0.0.0:0"});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  const json page = plumbd.WaitFor(
      "its page", [](const json& status) { return status["page"]["url"] != ""; })["page"];
  EXPECT_EQ(HttpClient(plumbd.port()).Get("/health").status, 200);
  EXPECT_EQ(page["certificate"], "");
  ASSERT_EQ(page["warnings"].size(), 1U);
  EXPECT_THAT(page["warnings"][0].get<std::string>(), HasSubstr("without TLS"));
  EXPECT_THAT(plumbd.log(), HasSubstr("without TLS"));
}

TEST_F(DaemonWebTest, AnEventStreamTellsAScanFromThePressToTheResultAnUnplugAndTheEnd) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  const HttpClient client = plumbd.MakeFirstAccount();
  HttpConnection stream(plumbd.port());
  ASSERT_TRUE(stream.Send(
      "GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\nCookie: " + client.cookie + "\r\n\r\n"));
  EXPECT_THAT(stream.ReadUntil("\"state\":\"ready\""), HasSubstr("text/event-stream"));
  plumbd.ScanOnce();
  for (const char* news : {"\"state\":\"scanning\"", "\"state\":\"working\"", "event: result"}) {
    EXPECT_FALSE(stream.ReadUntil(news).empty()) << news;
  }
  plumbd.Press(/*is_long=*/true);
  plumbd.WaitForState("ready");
  plumbd.Sim("unplug");
  EXPECT_FALSE(stream.ReadUntil("\"state\":\"no_sensor\"").empty());
  EXPECT_EQ(plumbd.Stop(), 0) << "an open stream keeps nothing from ending";
  EXPECT_TRUE(stream.ReadUntil("more").empty());
}

}  // namespace
}  // namespace plumb
