// SPDX-License-Identifier: Apache-2.0
// Who may ask for what: a table written by hand, against the answers of the server.
#include <gmock/gmock.h>

#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {
namespace {

/// T technician, P physicist, E engineer, D display in the room; "any": without a login.
/// A new route needs a line here, which is a decision about people, not about code.
const std::map<std::string, std::string> kWhoMay = {
    {"GET /", "any"},
    {"GET /room", "any"},
    {"GET /breath", "any"},
    {"GET /assets/{name}", "any"},
    {"GET /health", "any"},
    {"GET /authority.crt", "any"},
    {"GET /result", "any"},
    {"POST /login", "any"},
    {"POST /api/v1/setup", "any"},
    {"POST /api/v1/login", "any"},
    {"GET /api/v1/login/people", "any"},
    {"POST /api/v1/login/pin", "any"},
    {"POST /api/v1/displays/pair", "any"},
    {"POST /api/v1/displays/claim", "any"},
    {"POST /api/v1/logout", "TPED"},
    {"GET /api/v1/session", "TPED"},
    {"GET /api/v1/session/last-login", "TPED"},
    {"POST /api/v1/session/password", "TPED"},
    {"PUT /api/v1/session/preferences", "TPED"},
    {"GET /api/v1/status", "TPED"},
    {"GET /api/v1/events", "TPED"},
    {"GET /api/v1/preview", "TPED"},
    {"GET /api/v1/preview/outline", "TPED"},
    {"GET /api/v1/scan/surface", "TPED"},
    {"POST /api/v1/press", "TPE"},
    {"GET /api/v1/monitor", "TPED"},
    {"GET /api/v1/monitor/map", "TPED"},
    {"POST /api/v1/monitor/start", "TPE"},
    {"POST /api/v1/monitor/stop", "TPE"},
    {"GET /api/v1/monitor/record.csv", "TPE"},
    {"POST /api/v1/monitor/accept", "TP"},
    {"POST /api/v1/monitor/breath/teach", "TPE"},
    {"POST /api/v1/monitor/breath/forget", "TPE"},
    {"POST /api/v1/scan/start", "TPE"},
    {"GET /api/v1/sensor-repeats", "TPE"},
    {"POST /api/v1/sensor-repeats", "TPE"},
    {"POST /api/v1/scan/end", "TPE"},
    {"POST /api/v1/cancel", "TPE"},
    {"GET /api/v1/patients", "TPE"},
    {"POST /api/v1/patients", "TP"},
    {"GET /api/v1/patients/{id}", "TPED"},
    {"GET /api/v1/templates", "TPE"},
    {"PUT /api/v1/templates", "P"},
    {"POST /api/v1/templates/remove", "P"},
    {"PUT /api/v1/patients/{id}", "TP"},
    {"POST /api/v1/patients/{id}/archive", "P"},
    {"GET /api/v1/patients/{id}/photo", "TPE"},
    {"POST /api/v1/patients/{id}/photo", "TP"},
    {"DELETE /api/v1/patients/{id}/photo", "TP"},
    {"GET /api/v1/patients/{id}/drawing", "TPE"},
    {"PUT /api/v1/patients/{id}/drawing", "TP"},
    {"DELETE /api/v1/patients/{id}", "P"},
    {"POST /api/v1/patients/{id}/open", "TPE"},
    {"POST /api/v1/patients/{id}/planning", "P"},
    {"POST /api/v1/patients/{id}/planning/received", "P"},
    {"GET /api/v1/planning/received", "P"},
    {"GET /api/v1/worklist", "TPE"},
    {"GET /api/v1/patients/{id}/references", "TPE"},
    {"GET /api/v1/patients/{id}/scans", "TPE"},
    {"GET /api/v1/patients/{id}/report.pdf", "TPE"},
    {"GET /api/v1/patients/{id}/course.zip", "TPE"},
    {"GET /api/v1/patients/{id}/numbers.csv", "TPE"},
    {"GET /api/v1/patients/{id}/numbers.json", "TPE"},
    {"GET /api/v1/patients/{id}/statistics", "TPE"},
    {"GET /api/v1/statistics", "TPE"},
    {"GET /api/v1/statistics.csv", "TPE"},
    {"POST /api/v1/treatment/close", "TPE"},
    {"POST /api/v1/treatment/resume", "TPE"},
    {"POST /api/v1/treatment/wristband", "TPE"},
    {"POST /api/v1/treatment/reference", "TPE"},
    {"POST /api/v1/treatment/fraction", "TP"},
    {"POST /api/v1/references", "P"},
    {"GET /api/v1/references/{id}", "TPED"},
    {"PUT /api/v1/references/{id}/plan", "P"},
    {"POST /api/v1/references/{id}/approve", "P"},
    {"GET /api/v1/scans", "TPE"},
    {"GET /api/v1/scans/{id}", "TPED"},
    {"DELETE /api/v1/scans/{id}", "P"},
    {"POST /api/v1/scans/{id}/accept", "TP"},
    {"POST /api/v1/scans/{id}/accept-outside", "TP"},
    {"GET /api/v1/scans/{id}/report.pdf", "TPE"},
    {"GET /api/v1/scans/{id}/monitoring", "TPE"},
    {"GET /api/v1/scans/{id}/monitoring/{name}", "TPE"},
    {"GET /api/v1/scans/{id}/maps/{name}", "TPED"},
    {"GET /api/v1/scans/{id}/quality", "TPED"},
    {"GET /api/v1/scans/{id}/files/{name}", "TPED"},
    {"GET /api/v1/results/{id}", "TPED"},
    {"GET /api/v1/checks", "TPE"},
    {"POST /api/v1/checks/leave", "TPE"},
    {"POST /api/v1/checks/open", "TPE"},
    {"POST /api/v1/checks/{id}/baseline", "P"},
    {"GET /api/v1/room-calibration", "TPE"},
    {"GET /api/v1/room-calibration/board.pdf", "TPE"},
    {"POST /api/v1/room-calibration/sign", "PE"},
    {"POST /api/v1/couch", "PE"},
    {"GET /api/v1/sensor-profile", "TPE"},
    {"GET /api/v1/sensor-profile/{version}/file", "TPE"},
    {"POST /api/v1/sensor-profile/reset", "E"},
    {"POST /api/v1/sensor-profile/roll-back", "E"},
    {"GET /api/v1/displays/presence", "TPED"},
    {"PUT /api/v1/session/pin", "TPE"},
    {"DELETE /api/v1/session/pin", "TPE"},
    {"POST /api/v1/session/hand-over", "TPE"},
    {"GET /api/v1/session/list", "TPE"},
    {"DELETE /api/v1/session/list/{id}", "TPE"},
    {"POST /api/v1/session/end-others", "TPE"},
    {"POST /api/v1/session/second-factor/offer", "TPE"},
    {"POST /api/v1/session/second-factor", "TPE"},
    {"DELETE /api/v1/session/second-factor", "TPE"},
    {"GET /api/v1/displays", "E"},
    {"POST /api/v1/displays", "E"},
    {"DELETE /api/v1/displays/{id}", "E"},
    {"GET /api/v1/users", "E"},
    {"POST /api/v1/users", "E"},
    {"PUT /api/v1/users/{name}", "E"},
    {"GET /api/v1/audit", "PE"},
    {"GET /api/v1/audit.jsonl", "PE"},
    {"GET /api/v1/settings", "TPE"},
    {"PUT /api/v1/settings", "E"},
    {"GET /api/v1/update", "TPE"},
    {"POST /api/v1/update", "E"},
    {"POST /api/v1/update/bundles/{name}", "E"},
    {"POST /api/v1/update/restart", "E"},
    {"POST /api/v1/system/factory-reset", "E"},
    {"POST /api/v1/update/seen", "E"},
    {"DELETE /api/v1/update/bundles/{name}", "E"},
    {"GET /api/v1/backup", "E"},
    {"GET /api/v1/certificate", "E"},
    {"PUT /api/v1/certificate", "E"},
    {"POST /api/v1/certificate/new", "E"},
    {"POST /api/v1/backup", "E"},
    {"POST /api/v1/backup/verified", "E"},
    {"GET /api/v1/messages", "E"},
    {"POST /api/v1/messages/test", "E"},
    {"POST /api/v1/diagnostics", "E"},
};

constexpr std::string_view kRoles = "TPED";

class RolesTest : public WebTest {
 protected:
  void SetUp() override {
    Start([this](web::HttpServerOptions& options) { options.upload_folder = folder_.path(); });
    SetUpAccounts();
  }

  [[nodiscard]] HttpClient As(char role) {
    if (role == 'T') return LoggedIn("technician");
    if (role == 'P') return LoggedIn("physicist");
    if (role == 'E') return LoggedIn("engineer");
    HttpClient display(port_), engineer = LoggedIn("engineer");
    const nlohmann::json pairing = display.Post("/api/v1/displays/pair").json();
    EXPECT_EQ(engineer
                  .Post("/api/v1/displays",
                        {{"code", pairing["code"]}, {"name", "room"}, {"password", kPassword}})
                  .status,
              201);
    EXPECT_EQ(display.Post("/api/v1/displays/claim", {{"secret", pairing["secret"]}}).status, 200);
    display.FetchToken();
    return display;
  }

  /// A request for data that does not exist: only whether it is permitted counts.
  static HttpAnswer AskFor(HttpClient client, const std::string& route) {
    const std::size_t space = route.find(' ');
    std::string path = route.substr(space + 1);
    for (std::size_t at; (at = path.find('{')) != std::string::npos;)
      path.replace(at, path.find('}') - at + 1, "none");
    if (path.find("/update/bundles/") != std::string::npos || path.ends_with("/planning"))
      client.extra_headers["Content-Type"] = "application/octet-stream";
    const std::string method = route.substr(0, space);
    return client.Ask(method, path, method == "GET" || method == "DELETE" ? "" : "{}");
  }

  /// "GET /path" of every route of the server.
  [[nodiscard]] std::vector<std::string> Routes() const {
    std::vector<std::string> routes;
    for (const web::Route& route : server_->routes()) routes.push_back(route.Name());
    return routes;
  }

  plumb::testing::TempFolder folder_;
};

TEST_F(RolesTest, EveryRouteHasItsLineInTheTableAndEveryLineItsRoute) {
  std::vector<std::string> written;
  for (const auto& [route, who] : kWhoMay) written.push_back(route);
  EXPECT_THAT(Routes(), ::testing::UnorderedElementsAreArray(written));
}

TEST_F(RolesTest, EachRoleGetsPastTheGateWhereTheTableSaysSoAndNowhereElse) {
  std::map<char, HttpClient> clients;
  for (const char role : kRoles) clients.emplace(role, As(role));
  for (const std::string& route : Routes()) {
    const auto line = kWhoMay.find(route);
    ASSERT_NE(line, kWhoMay.end()) << route;
    const std::string& who = line->second;
    const int stranger = AskFor(HttpClient(port_), route).status;
    if (who == "any") {
      EXPECT_NE(stranger, 401) << route;
      continue;
    }
    EXPECT_EQ(stranger, 401) << route;
    for (const char role : kRoles) {
      const HttpAnswer answer = AskFor(clients.at(role), route);
      const bool is_refused =
          answer.status == 403 &&
          answer.body.find("your role is not allowed to do this") != std::string::npos;
      EXPECT_EQ(is_refused, who.find(role) == std::string::npos)
          << route << " as " << role << ": " << answer.status << ' ' << answer.body.substr(0, 200);
      EXPECT_NE(answer.status, 401) << route << " as " << role;
      if (route == "POST /api/v1/logout" && role != 'D') clients.at(role) = As(role);
    }
  }
}

}  // namespace
}  // namespace plumb::test
