// SPDX-License-Identifier: Apache-2.0
// Who saw and took what is in the log: read back through the API, as an engineer would.
#include "web/api/disclosures.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <set>

#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAreArray;

/// Routes to read from that show nothing of a patient: a new one needs a line here or a call of
/// Route::Discloses().
const std::set<std::string> kWithoutPatients = {
    "/",
    "/room",
    "/breath",
    "/assets/{name}",
    "/health",
    "/authority.crt",
    "/api/v1/session",
    "/api/v1/session/last-login",
    "/api/v1/login/people",  // names of staff, to a browser that knows them
    "/api/v1/status",        // the open session's code and no more, like the events
    "/api/v1/events",
    "/api/v1/templates",
    "/api/v1/checks",
    "/api/v1/room-calibration",
    "/api/v1/room-calibration/board.pdf",
    "/api/v1/sensor-profile",
    "/api/v1/sensor-repeats",
    "/api/v1/sensor-profile/{version}/file",
    "/api/v1/displays",
    "/api/v1/displays/presence",
    "/api/v1/session/list",
    "/api/v1/users",
    "/api/v1/monitor",
    "/api/v1/settings",
    "/api/v1/update",
    "/api/v1/backup",
    "/api/v1/messages",
    "/api/v1/certificate",
};

class DisclosuresTest : public WebTest {
 protected:
  void SetUp() override {
    Scan scan;
    scan.id = "s1";
    scan.patient_id = "p1";
    scan.outcome = ScanOutcome::kDone;
    scan.folder = folder_.path();
    std::filesystem::create_directories(scan.folder / "result");
    std::ofstream(scan.folder / "result/result.json") << "{}";
    service_.scans.push_back(scan);
    Start();
    SetUpAccounts();
  }

  /// "action subject detail" of the entries of one person, oldest first.
  [[nodiscard]] std::vector<std::string> Logged(const std::string& user, bool views = true) {
    HttpClient engineer = LoggedIn("engineer");
    const nlohmann::json log =
        engineer.Get(std::string("/api/v1/audit?limit=200&views=") + (views ? "1" : "0")).json();
    std::vector<std::string> lines;
    for (const auto& entry : log.at("entries")) {
      const std::string action = entry.at("action");
      if (entry.at("user") == user && (action.starts_with("view.") || action.starts_with("down")))
        lines.push_back(action + ' ' + entry.at("subject").get<std::string>() + ' ' +
                        entry.at("detail").get<std::string>());
    }
    std::ranges::reverse(lines);
    return lines;
  }

  plumb::testing::TempFolder folder_;
};

TEST_F(DisclosuresTest, EveryRouteToReadFromIsDecided) {
  std::vector<std::string> silent;
  for (const web::Route& route : server_->routes())
    if (route.method == "GET" && !route.DisclosesPatientData()) silent.push_back(route.pattern);
  EXPECT_THAT(silent, UnorderedElementsAreArray(kWithoutPatients));
}

TEST_F(DisclosuresTest, AViewIsLoggedOnceAnHourForEachPersonAndThing) {
  HttpClient technician = LoggedIn("technician"), physicist = LoggedIn("physicist");
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(technician.Get("/api/v1/scans/s1").status, 200);
    EXPECT_EQ(technician.Get("/api/v1/results/s1").status, 200);
  }
  EXPECT_THAT(Logged("technician"), ElementsAre("view.scan s1 "));
  EXPECT_THAT(Logged("physicist"), IsEmpty());
  EXPECT_EQ(physicist.Get("/result?scan=s1").status, 200);
  EXPECT_THAT(Logged("physicist"), ElementsAre("view.scan s1 "));
  EXPECT_EQ(physicist.Get("/api/v1/scans").status, 200);
  EXPECT_THAT(Logged("physicist"), ElementsAre("view.scan s1 ", "view.scans  "));
  EXPECT_THAT(Logged("physicist", /*views=*/false), IsEmpty());
}

TEST_F(DisclosuresTest, AfterAnHourItIsLoggedAgain) {
  EXPECT_EQ(LoggedIn("technician").Get("/api/v1/scans/s1").status, 200);
  skipped_s_ = 3500;
  EXPECT_EQ(LoggedIn("technician").Get("/api/v1/scans/s1").status, 200);
  EXPECT_THAT(Logged("technician"), ElementsAre("view.scan s1 "));
  skipped_s_ = 3700;
  EXPECT_EQ(LoggedIn("technician").Get("/api/v1/scans/s1").status, 200);
  EXPECT_THAT(Logged("technician"), ElementsAre("view.scan s1 ", "view.scan s1 "));
}

TEST_F(DisclosuresTest, EachDownloadIsLoggedWithItsFile) {
  HttpClient technician = LoggedIn("technician");
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(technician.Get("/api/v1/scans/s1/files/result.json?download").status, 200);
  EXPECT_EQ(technician.Get("/api/v1/scans/s1/report.pdf").status, 200);
  const std::vector<std::string> expected = {"download.file s1 result.json",
                                             "download.file s1 result.json",
                                             "download.report s1 report.pdf"};
  EXPECT_EQ(Logged("technician"), expected);
  EXPECT_EQ(Logged("technician", /*views=*/false), expected);
}

TEST_F(DisclosuresTest, WhatIsNotThereOrRefusedIsNotLogged) {
  HttpClient technician = LoggedIn("technician");
  EXPECT_EQ(technician.Get("/api/v1/scans/none").status, 404);
  EXPECT_EQ(technician.Get("/api/v1/audit").status, 403);
  EXPECT_EQ(technician.Get("/api/v1/scans/s1/files/mesh.ply?download").status, 404);
  EXPECT_EQ(HttpClient(port_).Get("/result").status, 200) << "the form to log in";
  EXPECT_THAT(Logged("technician"), IsEmpty());
  EXPECT_THAT(Logged(""), IsEmpty());
}

}  // namespace
}  // namespace plumb::test
