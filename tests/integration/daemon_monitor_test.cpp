// SPDX-License-Identifier: Apache-2.0
// Live monitoring by the whole plumbd: two sweeps, then the sensor at rest over the body, which is
// moved while it is watched.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>

#include <gmock/gmock.h>

#include "tests/support/plumbd.hpp"

namespace plumb::testing {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

class DaemonMonitorTest : public ::testing::Test {
 protected:
  static json Monitor(const Plumbd& plumbd, const char* action) {
    return plumbd.Ask({{"command", "monitor"}, {"action", action}});
  }
  TempFolder folder_;
};

TEST_F(DaemonMonitorTest, WatchesTheBodyAfterASweepAndHoldsWhenItMoves) {
  Plumbd plumbd(folder_.path(), {.arguments = {"--sim-rest"}, .scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  EXPECT_FALSE(Monitor(plumbd, "start").value("ok", true)) << "nothing was scanned yet";
  (void)plumbd.ScanOnce();
  plumbd.Sim("next-scene");
  (void)plumbd.ScanOnce();
  plumbd.Sim("mount");
  ASSERT_TRUE(Monitor(plumbd, "start").value("ok", false));
  EXPECT_FALSE(Monitor(plumbd, "start").value("ok", true)) << "once";
  const json begun = plumbd.WaitFor("numbers", [](const json& status) {
    return status["state"] == "monitoring" && status["monitor"]["state"] == "monitoring" &&
           status["monitor"]["against_reference"].is_object();
  });
  EXPECT_TRUE(begun["monitor"]["since_zero"].is_object());
  EXPECT_LT(begun["monitor"]["age_s"], 0.5);

  plumbd.Sim("move");
  plumbd.WaitFor("the motion", [](const json& status) {
    const json& numbers = status["monitor"]["since_zero"];
    return numbers.is_object() && std::abs(numbers["lateral_mm"].get<double>()) +
                                          std::abs(numbers["longitudinal_mm"].get<double>()) >
                                      3.5;
  });
  // No image any more: first unknown, then no number, and nothing else ends.
  plumbd.Sim("stall");
  plumbd.WaitFor("an unknown state", [](const json& status) {
    return status["monitor"]["advice"] == "unknown" && status["monitor"]["reason"] == "no_image";
  });
  plumbd.Sim("resume");
  plumbd.Press();
  plumbd.WaitForState("ready");
  // The sensor is where it was: the next press goes on watching. Taken up again, it starts a sweep.
  plumbd.WaitFor("rest", [](const json& status) {
    return status["press"] == "monitoring" && status["light"] == "ready_to_monitor";
  });
  plumbd.Press();
  plumbd.WaitForState("monitoring");
  plumbd.Press();
  plumbd.WaitForState("ready");
  plumbd.Sim("next-scene");
  plumbd.WaitFor("a hand", [](const json& status) { return status["press"] == "sweep"; });
  plumbd.Sim("mount");
  plumbd.WaitFor("rest again", [](const json& status) { return status["press"] == "monitoring"; });
  plumbd.Press();
  plumbd.WaitForState("monitoring");
  plumbd.Sim("unplug");
  plumbd.WaitForState("no_sensor");
  const json ended = plumbd.Status()["monitor"];
  EXPECT_EQ(ended["active"], false);
  EXPECT_TRUE(ended["since_zero"].is_null());
  EXPECT_NE(ended["ended"], "");
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonMonitorTest, ALivePositionIsSignedOnlyWhereTheSettingSaysSo) {
  Plumbd plumbd(folder_.path(), {.arguments = {"--sim-rest"}, .scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  test::HttpClient engineer = plumbd.MakeFirstAccount(), physicist(plumbd.port());
  ASSERT_EQ(engineer.LogIn("engineer", test::kPassword), 200);
  ASSERT_TRUE(test::AddAccount(plumbd.port(), engineer, "physicist", "physicist"));
  ASSERT_EQ(physicist.LogIn("physicist", test::kPassword), 200);
  (void)plumbd.ScanOnce();
  plumbd.Sim("next-scene");
  (void)plumbd.ScanOnce();
  plumbd.Sim("mount");
  ASSERT_TRUE(Monitor(plumbd, "start").value("ok", false));
  const char* const place = "/api/v1/monitor/accept";
  const json signature = {{"password", test::kPassword}, {"reason", "a test"}};
  plumbd.WaitFor("an advice against the reference", [](const json& status) {
    return status["monitor"]["against_reference"].is_object() &&
           status["monitor"]["advice"] != "unknown";
  });
  EXPECT_EQ(physicist.Post(place, signature).status, 409) << "a sweep has to confirm";
  ASSERT_EQ(engineer.Put("/api/v1/settings", {{"accept_live", "signature"}}).status, 200);
  EXPECT_EQ(engineer.Post(place, signature).status, 403) << "not an engineer's";
  EXPECT_EQ(physicist.Post(place, {{"password", "wrong"}, {"reason", "a test"}}).status, 403);
  EXPECT_TRUE(plumbd.Status()["monitor"]["accepted"].is_null());
  ASSERT_EQ(physicist.Post(place, signature).status, 200);
  const json accepted = plumbd.Status()["monitor"]["accepted"];
  EXPECT_EQ(accepted["by"], "physicist");
  EXPECT_TRUE(accepted["numbers"]["vertical_mm"].is_number());
  EXPECT_THAT(
      engineer.Get("/api/v1/audit?limit=20").body,
      ::testing::AllOf(::testing::HasSubstr("monitor.accept"), ::testing::HasSubstr("a test")));
  plumbd.Sim("stall");
  plumbd.WaitFor("an unknown state",
                 [](const json& status) { return status["monitor"]["advice"] == "unknown"; });
  EXPECT_EQ(physicist.Post(place, signature).status, 409) << "the value is old";
  EXPECT_EQ(physicist.Post("/api/v1/monitor/breath/forget").status, 409) << "none is taught";
  plumbd.Press();
  plumbd.WaitForState("ready");
  EXPECT_EQ(physicist.Post(place, signature).status, 409);
  EXPECT_EQ(physicist.Post("/api/v1/monitor/breath/teach").status, 409);
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonMonitorTest, ItsRecordOutlivesACutAndGoesWithThePatient) {
  PlumbdOptions options{.arguments = {"--sim-rest"}, .scenes = 2};
  std::string scan, patient;
  {
    Plumbd plumbd(folder_.path(), options);
    ASSERT_TRUE(plumbd.WaitUntilUp());
    (void)plumbd.MakeFirstAccount();
    (void)plumbd.ScanOnce();
    plumbd.Sim("next-scene");
    scan = plumbd.ScanOnce()["last_result"]["scan"];
    plumbd.Sim("mount");
    ASSERT_TRUE(Monitor(plumbd, "start").value("ok", false));
    std::optional<int> first;
    plumbd.WaitFor("two seconds of numbers", [&](const json& status) {
      const json& now = status["monitor"];
      if (!now["against_reference"].is_object()) return false;
      if (!first) first = now["frames"].get<int>();
      return now["frames"].get<int>() > *first + 60;
    });
    EXPECT_EQ(plumbd.Status()["monitor"]["is_recorded"], true);
    plumbd.Signal(SIGKILL);
    EXPECT_EQ(plumbd.Wait(), -SIGKILL);
  }
  Plumbd plumbd(folder_.path(), options);
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  test::HttpClient engineer(plumbd.port()), physicist(plumbd.port());
  ASSERT_EQ(engineer.LogIn("engineer", test::kPassword), 200);
  const std::string place = "/api/v1/scans/" + scan + "/monitoring";
  const json records = engineer.Get(place).json()["records"];
  ASSERT_EQ(records.size(), 1u);
  EXPECT_EQ(records[0]["head"]["scan"], scan);
  EXPECT_EQ(records[0]["head"]["judges"], "against_reference");
  const json report = engineer.Get(place + "/1.json").json();
  EXPECT_GT(report["advice_s"].size(), 0u);
  EXPECT_GT(report["states_s"]["monitoring"].get<double>(), 0.5);
  EXPECT_EQ(report["said"][0]["event"], "zero");
  EXPECT_EQ(report["said"].size(), 1u) << "the record was cut off";
  const std::string csv = engineer.Get(place + "/1.csv?download").body;
  EXPECT_THAT(csv, ::testing::HasSubstr("ref_lateral_mm"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + report["frames"].get<int>());
  EXPECT_EQ(engineer.Get(place + "/2.json").status, 404);
  EXPECT_EQ(engineer.Get(place + "/2.csv").status, 404);
  EXPECT_THAT(engineer.Get("/api/v1/audit?limit=20").body,
              ::testing::HasSubstr("download.monitoring"));

  // In a backup, and wiped with the patient.
  const std::filesystem::path file = "scans/" + scan + "/monitoring/01.plm";
  EXPECT_TRUE(std::filesystem::exists(plumbd.state() / file));
  ASSERT_TRUE(
      plumbd.Ask({{"command", "backup"}, {"folder", folder_ / "backup"}}).value("ok", false));
  EXPECT_EQ(std::filesystem::file_size(folder_ / "backup" / file),
            std::filesystem::file_size(plumbd.state() / file));
  ASSERT_TRUE(test::AddAccount(plumbd.port(), engineer, "physicist", "physicist"));
  ASSERT_EQ(physicist.LogIn("physicist", test::kPassword), 200);
  patient = physicist.Get("/api/v1/scans/" + scan).json()["patient_id"];
  const std::string body = json{{"password", test::kPassword}}.dump();
  EXPECT_EQ(physicist.Ask("DELETE", "/api/v1/patients/" + patient, body).status, 200);
  EXPECT_FALSE(std::filesystem::exists(plumbd.state() / file));
  EXPECT_EQ(plumbd.Stop(), 0);
}

}  // namespace
}  // namespace plumb::testing
