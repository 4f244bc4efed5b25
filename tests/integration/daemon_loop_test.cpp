// SPDX-License-Identifier: Apache-2.0
// Nothing on plumbd's event loop takes over 10 ms: the real process measures it itself, over
// a day's typical use.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <cstdio>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/sanitized.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using test::HttpClient;
using test::kPassword;
using testing::Plumbd;

constexpr bool kJudges = !testing::kIsSanitized;  // several times slower: only reported
/// Work that takes too long does so nearly every time. What hits one turn of many is not the
/// loop's: by hand on a busy machine (load 8 to 10), 5 of 470 000 turns that move bytes only had 10
/// to 14 ms of own time, since the kernel charges an interrupt to the running process, and a
/// virtual machine what its host takes away. A kind of turn is judged slow if it is over the limit
/// in every attempt and more often than this.
constexpr int kAttempts = 2;
constexpr double kAccidents = 1e-3;
constexpr std::size_t kBundleMiB = 320;  // removed on the loop it would cost 17 to 50 ms

class DaemonLoopTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }
};

/// Watches as a browser does until destroyed.
class Viewer {
 public:
  Viewer(std::uint16_t port, const HttpClient& person) : port_(port), cookie_(person.cookie) {}

 private:
  void Watch(const std::stop_token& stop) const {
    test::HttpConnection events(port_);
    events.Send("GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\nCookie: " + cookie_ +
                "\r\n\r\n");
    HttpClient client(port_);
    client.cookie = cookie_;
    while (!stop.stop_requested()) {
      (void)events.ReadUntil("\n\n");  // an event, or the beat
      (void)client.Get("/api/v1/preview");
      (void)client.Get("/api/v1/status");
    }
  }
  std::uint16_t port_;
  std::string cookie_;
  std::jthread thread_{[this](const std::stop_token& stop) { Watch(stop); }};
};

void ExamineAll(HttpClient& person, const std::vector<std::string>& scans) {
  for (const char* path : {"/api/v1/scans", "/api/v1/patients", "/api/v1/patients/1/scans",
                           "/api/v1/patients/1/references", "/api/v1/checks", "/api/v1/settings",
                           "/api/v1/update", "/result", "/", "/health"}) {
    EXPECT_EQ(person.Get(path).status, 200) << path;
  }
  for (const std::string& scan : scans) {
    for (const char* file : {"mesh.ply", "cloud.ply", "heightmap.tiff", "scene.json"}) {
      EXPECT_EQ(person.Get("/api/v1/scans/" + scan + "/files/" + file).status, 200) << file;
    }
  }
}

/// Refused at its end, where there is no RAUC, or for its form: it goes to the disk and from there.
void SendBundle(std::uint16_t port, const HttpClient& engineer) {
  test::HttpConnection connection(port);
  connection.Send("POST /api/v1/update/bundles/a.raucb HTTP/1.1\r\nHost: localhost\r\nCookie: " +
                  engineer.cookie + "\r\nX-CSRF-Token: " + engineer.csrf_token +
                  "\r\nContent-Type: application/octet-stream\r\nContent-Length: " +
                  std::to_string(kBundleMiB << 20) + "\r\n\r\n");
  const std::string piece(1 << 20, 'x');
  for (std::size_t i = 0; i < kBundleMiB; ++i) connection.Send(piece);
  EXPECT_GE(connection.Read().status, 400);
}

/// The meter's figures after all of it.
json WorkflowFigures() {
  const testing::TempFolder folder;
  Plumbd plumbd(folder.path(), {.scenes = 2});
  EXPECT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  HttpClient engineer = plumbd.MakeFirstAccount(), physicist(plumbd.port());
  EXPECT_TRUE(test::AddAccount(plumbd.port(), engineer, "physicist", "physicist"));
  EXPECT_EQ(physicist.LogIn("physicist", kPassword), 200);
  std::vector<std::string> scans;
  {
    const Viewer one(plumbd.port(), engineer), two(plumbd.port(), physicist);
    scans.push_back(plumbd.ScanOnce()["last_result"]["scan"]);
    EXPECT_EQ(plumbd.Sim("next-scene")["ok"], true);
    scans.push_back(plumbd.ScanOnce()["last_result"]["scan"]);
    ExamineAll(engineer, scans);
    SendBundle(plumbd.port(), engineer);
    EXPECT_EQ(engineer.Post("/api/v1/diagnostics").status, 200);
    EXPECT_EQ(physicist.Get("/api/v1/audit").status, 200);
    plumbd.Signal(SIGHUP);
    plumbd.WaitForLog("the configuration was read again");
    EXPECT_EQ(
        physicist.Ask("DELETE", "/api/v1/patients/1", json{{"password", kPassword}}.dump()).status,
        200);
    plumbd.Sim("unplug");
    plumbd.WaitForState("no_sensor");
  }
  const json loop = plumbd.Status()["loop"];
  EXPECT_EQ(plumbd.Stop(), 0);
  return loop;
}

/// The kinds of turns that were slow more often than by accident.
std::set<std::string> SlowKinds(const json& loop) {
  std::set<std::string> kinds;
  for (const auto& [what, turns] : loop["slow"].items()) {
    if (turns["times"].get<double>() > kAccidents * turns["of"].get<double>()) kinds.insert(what);
  }
  return kinds;
}

TEST_F(DaemonLoopTest, NothingTakesOver10MsOfTheLoopsOwnTime) {
  std::set<std::string> slow;
  for (int attempt = 0; attempt < kAttempts && !HasFailure(); ++attempt) {
    const json loop = WorkflowFigures();
    std::printf("%s\n", loop.dump().c_str());
    std::fflush(stdout);
    EXPECT_GT(loop.value("turns", 0), 1000);
    const std::set<std::string> kinds = SlowKinds(loop);
    if (attempt == 0) slow = kinds;
    std::erase_if(slow, [&](const std::string& kind) { return !kinds.contains(kind); });
    if (!kJudges || slow.empty()) return;
  }
  EXPECT_THAT(slow, ::testing::IsEmpty())
      << "in each of " << kAttempts << " runs over 10 ms of the loop's own time";
}

}  // namespace
}  // namespace plumb
