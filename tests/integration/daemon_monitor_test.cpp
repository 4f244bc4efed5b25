// SPDX-License-Identifier: Apache-2.0
// Live monitoring by the whole plumbd: two sweeps, then the sensor at rest over the body, which is
// moved while it is watched.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
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
  // A sweep that lost many frames gives no zero, and how many a loaded machine loses is not tested.
  plumbd.Sim("speed", "0.5");
  (void)plumbd.ScanOnce();
  plumbd.Sim("next-scene");
  (void)plumbd.ScanOnce();
  plumbd.Sim("speed", "1");
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

/// Two sensors on both sides of the body.
class DaemonTwoSensorsTest : public DaemonMonitorTest {
 protected:
  static constexpr const char* kFirst = "VIRTUAL-0001";
  static constexpr const char* kSecond = "VIRTUAL-0002";

  DaemonTwoSensorsTest() {
    std::ofstream(folder_ / "plumb.toml") << "[appliance]\nsensor_serial = \"" << kFirst
                                          << "\"\nsecond_sensor_serial = \"" << kSecond << "\"\n";
  }
  static json Shares(const json& status) {
    json shares = json::array();
    for (const json& sensor : status["monitor"]["sensors"]) shares.push_back(sensor["share"]);
    return shares;
  }
  static auto Used(const char* first, const char* second) {
    return [=](const json& status) {
      return status["monitor"]["state"] == "monitoring" && Shares(status) == json{first, second} &&
             status["monitor"]["since_zero"].is_object();
    };
  }
  /// Of the motion that `move` makes, 3 and 4 mm; of none before it.
  static bool IsWithin(const json& status, double mm) {
    const json& numbers = status["monitor"]["since_zero"];
    double square = 0, variance = 0;
    for (const char* axis : {"lateral", "longitudinal", "vertical"}) {
      const std::string name(axis);
      square += std::pow(numbers[name + "_mm"].get<double>(), 2);
      variance += std::pow(numbers[name + "_u95_mm"].get<double>(), 2);
    }
    return std::abs(std::sqrt(square) - mm) <= std::sqrt(variance);
  }
  static double U95(const json& status) {
    return status["monitor"]["since_zero"]["lateral_u95_mm"].get<double>() +
           status["monitor"]["since_zero"]["longitudinal_u95_mm"].get<double>();
  }
};

TEST_F(DaemonTwoSensorsTest, OneGoesOnAloneAndSaysSoAndTheOtherComesBack) {
  Plumbd plumbd(
      folder_.path(),
      {.arguments = {"--sim-rest", "--config", (folder_ / "plumb.toml").string()}, .scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  EXPECT_EQ(plumbd.Status()["sensor"]["others"], json::array()) << "the second one has its use";
  test::HttpClient engineer = plumbd.MakeFirstAccount();
  (void)plumbd.ScanOnce();
  plumbd.Sim("next-scene");
  const std::string scan = plumbd.ScanOnce()["last_result"]["scan"];
  plumbd.Sim("mount");
  ASSERT_TRUE(Monitor(plumbd, "start").value("ok", false));
  const json both = plumbd.WaitFor("both sensors", Used("used", "used"));
  EXPECT_EQ(both["monitor"]["sensors"][0]["serial"], kFirst);
  EXPECT_EQ(both["monitor"]["sensors"][1]["serial"], kSecond);
  EXPECT_EQ(both["monitor"]["one_sensor"], "");

  plumbd.Sim("move");
  plumbd.WaitFor("the motion, seen by both", [](const json& status) {
    return Used("used", "used")(status) && IsWithin(status, 5.0) && !IsWithin(status, 0.0);
  });
  EXPECT_EQ(engineer.Get("/api/v1/monitor/map").body.substr(0, 4), "PLM1");
  // The first one, which the appliance otherwise waits for.
  plumbd.Sim("unplug", kFirst);
  const json second = plumbd.WaitFor("the second one alone", [](const json& status) {
    return Used("no_image", "used")(status) && IsWithin(status, 5.0);
  });
  EXPECT_EQ(second["monitor"]["one_sensor"],
            "no image comes from sensor VIRTUAL-0001: VIRTUAL-0002 continues alone, with wider "
            "intervals");
  EXPECT_EQ(second["monitor"]["one_sensor_message"]["id"], "monitoring.sensor_silent");
  EXPECT_EQ(second["state"], "monitoring");
  plumbd.Sim("plug", kFirst);
  const json again = plumbd.WaitFor("both again", [](const json& status) {
    return Used("used", "used")(status) && IsWithin(status, 5.0);
  });
  EXPECT_EQ(again["monitor"]["one_sensor"], "");
  EXPECT_GT(U95(second), 0.9 * U95(again)) << "one alone knows less";
  plumbd.Sim("stall", kSecond);
  plumbd.WaitFor("the first one alone", Used("used", "no_image"));
  plumbd.Sim("unplug", kFirst);
  plumbd.WaitFor("nothing known", [](const json& status) {
    const json& now = status["monitor"];
    return now["advice"] == "unknown" && now["since_zero"].is_null() &&
           now["reason"] == "no_image" && Shares(status) == json{"no_image", "no_image"};
  });
  EXPECT_EQ(engineer.Get("/api/v1/monitor/map").status, 404) << "none is newer than a second";
  plumbd.Sim("resume", kSecond);
  plumbd.WaitFor("the second one again", Used("no_image", "used"));
  plumbd.Press();
  plumbd.WaitForState("no_sensor");
  const std::string place = "/api/v1/scans/" + scan + "/monitoring";
  json records;
  plumbd.WaitFor("the record", [&](const json&) {
    records = engineer.Get(place).json()["records"];
    return records.size() == 1;
  });
  EXPECT_EQ(records[0]["head"]["sensor_serial"], kFirst);
  EXPECT_EQ(records[0]["head"]["second_sensor_serial"], kSecond);
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonTwoSensorsTest, WithoutTheSecondOneTheFirstMonitorsAloneAndSaysSo) {
  Plumbd plumbd(
      folder_.path(),
      {.arguments = {"--sim-rest", "--config", (folder_ / "plumb.toml").string()}, .scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  (void)plumbd.ScanOnce();
  plumbd.Sim("next-scene");
  (void)plumbd.ScanOnce();
  plumbd.Sim("unplug", kSecond);
  plumbd.Sim("mount");
  ASSERT_TRUE(Monitor(plumbd, "start").value("ok", false));
  const json alone = plumbd.WaitFor("numbers", [](const json& status) {
    return status["monitor"]["state"] == "monitoring" &&
           status["monitor"]["since_zero"].is_object();
  });
  EXPECT_EQ(alone["monitor"]["warning_messages"][0]["id"], "monitoring.second_missing");
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonMonitorTest, ThePlaceOfAFixedSensorIsLearnedByTheRoomsMarkersAndCheckedEachTime) {
  const std::filesystem::path config = folder_ / "plumb.toml";
  std::ofstream(config) << "[appliance]\nfixed_sensors = [\"VIRTUAL-0001\"]\n[iec]\n"
                           "T_iec_reference = [[0, 1, 0, 0.1], [-1, 0, 0, 0.2], [0, 0, 1, -0.3], "
                           "[0, 0, 0, 1]]\n";
  Plumbd plumbd(folder_.path(),
                {.arguments = {"--sim-rest", "--config", config.string()}, .scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  (void)plumbd.ScanOnce();
  plumbd.Sim("next-scene");
  (void)plumbd.ScanOnce();
  plumbd.Sim("mount");
  const auto warning = [&] {
    EXPECT_TRUE(Monitor(plumbd, "start").value("ok", false));
    const json now = plumbd.WaitFor(
        "numbers", [](const json& status) { return status["monitor"]["since_zero"].is_object(); });
    EXPECT_TRUE(Monitor(plumbd, "stop").value("ok", false));
    plumbd.WaitForState("ready");
    const json& warnings = now["monitor"]["warning_messages"];
    return warnings.empty() ? std::string() : warnings[0]["id"].get<std::string>();
  };
  EXPECT_EQ(warning(), "monitoring.place_learned");
  EXPECT_EQ(warning(), "") << "it stands where it did";
  // As if it had been moved by 20 mm since it was learned.
  const std::filesystem::path file = folder_ / "state" / "fixed-sensors.json";
  json places = json::parse(std::ifstream(file));
  places["VIRTUAL-0001"][3] = places["VIRTUAL-0001"][3].get<double>() + 0.02;
  std::ofstream(file) << places;
  EXPECT_EQ(warning(), "monitoring.place_other");
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonMonitorTest, TheOutlineIsThatOfTheReferenceOfTheOpenSessionAndOfNothingElse) {
  Plumbd plumbd(folder_.path(), {.arguments = {"--sim-rest"}, .scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  test::HttpClient engineer = plumbd.MakeFirstAccount();
  const auto outline = [&] { return engineer.Get("/api/v1/preview/outline"); };
  const auto wait_for = [&](const char* what, int status) {
    plumbd.WaitFor(what, [&](const json&) { return outline().status == status; });
  };
  plumbd.WaitForState("ready");
  EXPECT_EQ(outline().status, 404) << "no reference";
  (void)plumbd.ScanOnce();
  json found;
  const auto is_placed = [&](const json&) {
    found = outline().json();
    return found.value("is_placed", false) && !found["lines"].empty();
  };
  plumbd.WaitFor("an outline", is_placed);
  for (const json& line : found["lines"]) {
    EXPECT_GE(line.size(), 2U);
    for (const json& point : line) {
      EXPECT_TRUE(point[0] >= 0 && point[0] <= 1 && point[1] >= 0 && point[1] <= 1) << point;
    }
  }
  // Before a sweep as in it: also of a body that lies elsewhere.
  plumbd.Sim("next-scene");
  plumbd.Press();
  plumbd.WaitForState("scanning");
  plumbd.WaitFor("an outline during the sweep", is_placed);
  plumbd.Press(/*is_long=*/true);
  plumbd.WaitForState("ready");
  ASSERT_EQ(engineer.Post("/api/v1/checks/open").status, 200);
  EXPECT_EQ(outline().status, 404) << "a daily check belongs to no patient";
  ASSERT_EQ(engineer.Post("/api/v1/checks/leave").status, 200);
  wait_for("an outline again", 200);
  const json session = engineer.Get("/api/v1/status").json()["session"];
  ASSERT_EQ(engineer.Post("/api/v1/treatment/close", {{"session_id", session["id"]}}).status, 200);
  EXPECT_EQ(outline().status, 404) << "nothing of a patient whose session is closed";
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
