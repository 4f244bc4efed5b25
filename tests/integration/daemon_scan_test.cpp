// SPDX-License-Identifier: Apache-2.0
// Scans of a real plumbd: from the press to the six numbers, against the truth and against their
// own recordings.
#include <csignal>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "algo/base/units.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/demo_truth.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/process.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Plumbd;

const std::vector<const char*> kSixNumbers = {"vertical_mm", "longitudinal_mm", "lateral_mm",
                                              "pitch_deg",   "roll_deg",        "yaw_deg"};

class DaemonScanTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  static json ReadJson(const fs::path& file) { return json::parse(ReadTextFile(file, 1 << 24)); }

  testing::TempFolder folder_;
};

TEST_F(DaemonScanTest, TwoPressesAndTwoMoreGiveTheSixNumbersOfTheBodysTrueMotion) {
  Plumbd plumbd(folder_.path(), {.scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  EXPECT_THAT(plumbd.notifications(), HasSubstr("READY=1"));
  const json first = plumbd.ScanOnce();
  EXPECT_EQ(first["last_result"]["is_reference"], true);
  EXPECT_EQ(plumbd.Sim("next-scene")["ok"], true);
  const json second = plumbd.ScanOnce();
  const json last = second["last_result"];
  EXPECT_EQ(last["verdict"], "move");
  for (const char* name : kSixNumbers) EXPECT_TRUE(last[name].is_number()) << name;

  const fs::path scan = plumbd.state() / "scans" / last["scan"].get<std::string>();
  EXPECT_TRUE(fs::exists(scan / "scene" / "scene.json"));
  const json result = ReadJson(scan / "result" / "result.json");
  for (const char* name : kSixNumbers) EXPECT_EQ(last[name], result["correction"][name]) << name;
  // A quarter of the pixels at twice the usual speed; the motion itself is 50 mm and 3.4 deg. A
  // wrong sign or frame misses by that much.
  const testing::MotionError error = testing::ErrorOfMotion(result);
  std::printf("the motion is off by %.2f mm, %.3f deg\n", error.translation_m / kMillimetre,
              error.rotation_rad / kDegree);
  // Measured: 0.43 mm, 0.085 deg with every frame. With frames lost it was up to twice 2.2 mm.
  const bool is_whole = last["frames_dropped"] == 0 && first["last_result"]["frames_dropped"] == 0;
  EXPECT_LT(error.translation_m, (is_whole ? 0.6 : 6.0) * kMillimetre);
  EXPECT_LT(error.rotation_rad, (is_whole ? 0.1 : 0.3) * kDegree);
  ::testing::Test::RecordProperty("after_last_frame_s", last["after_last_frame_s"].dump());
  std::printf(
      "result %.2f s after the last frame, first frame used %.0f ms after the press, %d frames "
      "dropped\n",
      last["after_last_frame_s"].get<double>(), second["scan"]["first_frame_ms"].get<double>(),
      last["frames_dropped"].get<int>());
  EXPECT_EQ(plumbd.Stop(), 0);
  EXPECT_THAT(plumbd.notifications(), HasSubstr("STOPPING=1"));
  EXPECT_FALSE(fs::exists(plumbd.state() / "scans" / ".staging-000003"));
}

TEST_F(DaemonScanTest, TheResultIsTheSameWhenTheRecordingIsComputedAgain) {
  std::ofstream(folder_ / "plumb.toml")
      << "[appliance]\nsensor_profiles = false\n[reconstruct]\nkeep_color = false\n";
  Plumbd plumbd(folder_.path(),
                {.arguments = {"--config", folder_ / "plumb.toml"},
                 .scenes = 2,
                 .settings = [](Settings& settings) { settings.keep_recordings = true; }});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.ScanOnce();
  ASSERT_EQ(plumbd.Sim("next-scene")["ok"], true);
  const json live = plumbd.ScanOnce()["last_result"];
  ASSERT_EQ(plumbd.Stop(), 0);
  EXPECT_FALSE(fs::exists(plumbd.state() / "sensor-profiles")) << "switched off";
  for (const char* id : {"000001", "000002"}) {
    const fs::path recording = plumbd.state() / "scans" / id / "recording";
    const RunResult again = plumb::Run({PLUMB_BINARY, "reconstruct", recording, "--out",
                                        folder_ / id, "--config", folder_ / "plumb.toml"});
    ASSERT_EQ(again.exit_code, 0) << again.err;
    const auto live_poses =
        ReadTextFile(plumbd.state() / "scans" / id / "scene" / "trajectory.txt", 1 << 20);
    EXPECT_EQ(ReadTextFile(folder_ / id / "trajectory.txt", 1 << 20), live_poses)
        << id << ": the same frames, the same poses to the last digit";
  }
  // The simulated room's axes, which plumbd takes by itself: the head points to the gantry.
  WriteWholeFile(folder_ / "room.toml",
                 std::string_view("[iec]\nT_iec_reference = [[0, 1, 0, 0], [-1, 0, 0, 0], "
                                  "[0, 0, 1, 0], [0, 0, 0, 1]]\n"));
  const RunResult compared =
      plumb::Run({PLUMB_BINARY, "compare", folder_ / "000001", folder_ / "000002", "--out",
                  folder_ / "result", "--config", folder_ / "room.toml", "--json"});
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  const json replayed = json::parse(compared.out)["correction"];
  for (const char* name : kSixNumbers) {
    EXPECT_NEAR(replayed[name].get<double>(), live[name].get<double>(),
                std::string(name).ends_with("deg") ? 0.05 : 0.5)
        << name;
  }
  const json body = json::parse(compared.out)["body"];
  EXPECT_EQ(body["named_by"], "posture") << "the demo lies head first supine, along the couch";
}

TEST_F(DaemonScanTest, WhatAGoodScanTaughtOfTheSensorIsWhereTheNextOneBegins) {
  Plumbd plumbd(folder_.path(), {.scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  const std::string serial = plumbd.WaitForState("ready")["sensor"]["serial"];
  const fs::path profiles = plumbd.state() / "sensor-profiles" / serial;
  const auto scene_of = [&](const json& status) {
    const std::string scan = status["last_result"]["scan"];
    return ReadJson(plumbd.state() / "scans" / scan / "scene" / "scene.json");
  };
  EXPECT_TRUE(scene_of(plumbd.ScanOnce())["sensor_profile"].is_null());
  EXPECT_TRUE(fs::exists(profiles / "000001.profile")) << plumbd.log();
  ASSERT_EQ(plumbd.Sim("next-scene")["ok"], true);
  EXPECT_EQ(scene_of(plumbd.ScanOnce())["sensor_profile"], serial + " version 1, 1 sweep");
  EXPECT_TRUE(fs::exists(profiles / "000002.profile")) << plumbd.log();
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonScanTest, ASweepEndsByItselfWhenNothingNewIsSeen) {
  Plumbd plumbd(folder_.path(),
                {.settings = [](Settings& settings) { settings.auto_stop_s = 1.5; }});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  EXPECT_EQ(plumbd.Press()["ok"], true);
  const json status = plumbd.WaitForState("result");
  EXPECT_GE(status["last_result"]["frames"].get<int>() +
                status["last_result"]["frames_dropped"].get<int>(),
            120)
      << "the whole sweep was used, and then some time in which nothing new came";
}

TEST_F(DaemonScanTest, ASweepEndsAtTheLimitThatTheFileGivesAsAFirstSetting) {
  std::ofstream(folder_ / "plumb.toml") << "[appliance]\nscan_limit_s = 1\n";
  Plumbd plumbd(folder_.path(), {.arguments = {"--config", folder_ / "plumb.toml"}});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  EXPECT_EQ(plumbd.Press()["ok"], true);
  plumbd.WaitForState("result");
  EXPECT_THAT(plumbd.log(), HasSubstr("longest duration"));
}

TEST_F(DaemonScanTest, AResultIsPutAwayAfterItsTimeAndThePressStartsTheNextScanBefore) {
  Plumbd plumbd(folder_.path(),
                {.arguments = {"--sim-result-s", "10"},
                 .settings = [](Settings& settings) { settings.scan_limit_s = 1; }});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.Press();
  const json first = plumbd.WaitForState("result");
  EXPECT_EQ(plumbd.Press()["ok"], true) << "its 10 s are not over";
  const json later = plumbd.WaitForState("ready");
  EXPECT_TRUE(later["last_result"].is_object()) << "the status still has the last result";
  EXPECT_NE(later["last_result"]["scan"], first["last_result"]["scan"])
      << "there was a second scan";
}

TEST_F(DaemonScanTest, WatchersSeeStatesAndProgressAndTheSocketIsTheOwnersOnly) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  Process watch({PLUMB_BINARY, "--control", plumbd.socket(), "watch"},
                {.num_cpus = 0, .max_file_bytes = 0, .stdout_path = {}});
  struct stat status {};
  ASSERT_EQ(::stat(plumbd.socket().c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0117, 0U) << "only owner and group have access";
  ASSERT_TRUE(watch.WaitForStdout("\"status\""));
  EXPECT_EQ(plumbd.Press()["ok"], true);
  plumbd.WaitForFrames(30);
  EXPECT_EQ(plumbd.Press(/*is_long=*/true)["ok"], true);
  plumbd.WaitForState("ready");
  EXPECT_EQ(plumbd.Stop(), 0);
  EXPECT_EQ(watch.Wait(), 5);
  std::vector<std::string> events, states;
  std::istringstream lines(watch.out());
  for (std::string line; std::getline(lines, line);) {
    const json event = json::parse(line);
    EXPECT_TRUE(event["time"].is_number()) << line;
    events.push_back(event["event"]);
    if (event["event"] == "state") states.push_back(event["state"]);
  }
  EXPECT_EQ(events.front(), "status");
  EXPECT_THAT(events, ::testing::Contains("progress"));
  EXPECT_THAT(states, ::testing::ElementsAre("scanning", "scanning", "ready"));
}

}  // namespace
}  // namespace plumb
