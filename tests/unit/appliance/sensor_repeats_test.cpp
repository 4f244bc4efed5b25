// SPDX-License-Identifier: Apache-2.0
// Three sweeps of a thing that did not move, through the page's service and kept with the unit.
#include "daemon/services/sensor_repeats.hpp"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/files/scene_folder.hpp"
#include "tests/support/synthetic_scene.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using std::chrono::minutes;
using ::testing::ElementsAre;
using ::testing::SizeIs;

class SensorRepeatsTest : public ::testing::Test {
 protected:
  /// A sweep without a patient, of a body that lies there.
  Scan Sweep(const std::string& id, WallClock::time_point time, double shift_m = 0.0) {
    Scan scan;
    scan.id = id;
    scan.outcome = ScanOutcome::kDone;
    scan.started_at = time;
    scan.sensor_serial = "A";
    scan.folder = folder_ / id;
    test::SyntheticOptions options;
    options.seed = static_cast<unsigned>(std::stoi(id));
    options.noise_m = 0.0005;
    options.T_reference_body.translation().x() = shift_m;
    Scene scene = test::MakeSyntheticScene(options);
    scene.sensitivity = test::KnownCalibration(scene);
    std::filesystem::create_directories(scan.folder);
    WriteScene(scene, scan.folder / "scene");
    return scan;
  }
  SensorRepeats Found(const std::vector<Scan>& scans) {
    return RepeatsOf("A", scans, shelf_, now_);
  }
  nlohmann::json Judge(const std::vector<Scan>& scans) {
    JudgeRepeatsOf(Found(scans), scans, {}, {.user = "bob", .address = {}}, shelf_, now_);
    return nlohmann::json::parse(Found(scans).judged);
  }
  static std::vector<std::string> Ids(const SensorRepeats& repeats) {
    std::vector<std::string> ids;
    for (const SensorRepeats::Sweep& sweep : repeats.sweeps) ids.push_back(sweep.scan_id);
    return ids;
  }

  const WallClock::time_point now_ = WallClock::now();
  testing::TempFolder folder_;
  ProfileShelf shelf_{folder_ / "profiles"};
};

TEST_F(SensorRepeatsTest, OnlyFreshSweepsOfThisUnitWithoutAPatientCount) {
  std::vector<Scan> scans;
  for (int i = 9; i > 0; --i) {
    Scan scan;
    scan.id = std::to_string(i);
    scan.outcome = ScanOutcome::kDone;
    scan.started_at = now_ - minutes(10 * (9 - i));
    scan.sensor_serial = "A";
    scans.push_back(scan);
  }
  EXPECT_THAT(Ids(Found(scans)), ElementsAre("7", "8", "9"));
  scans[0].patient_id = "1";
  scans[1].sensor_serial = "B";
  scans[2].outcome = ScanOutcome::kFailed;
  EXPECT_THAT(Ids(Found(scans)), ElementsAre("4", "5", "6"));
  scans[3].purpose = ScanPurpose::kDailyCheck;
  EXPECT_THAT(Ids(Found(scans)), ElementsAre("4", "5")) << "the others are an hour old";
  EXPECT_TRUE(Found(scans).is_due);
  EXPECT_THROW(JudgeRepeatsOf(Found(scans), scans, {}, {}, shelf_, now_), DataError);
  EXPECT_EQ(Found(scans).judged, "");
}

TEST_F(SensorRepeatsTest, TheJudgementStaysWithTheUnitUntilItsProfileIsReset) {
  std::vector<Scan> scans;
  for (int i = 3; i > 0; --i) scans.push_back(Sweep(std::to_string(i), now_ - minutes(4 - i)));
  ASSERT_TRUE(Found(scans).is_due);
  const nlohmann::json judged = Judge(scans);
  EXPECT_THAT(judged["pairs"], SizeIs(3));
  EXPECT_EQ(judged["user"], "bob");
  EXPECT_THAT(judged["scans"], ElementsAre("1", "2", "3"));
  EXPECT_EQ(judged["fit"], true) << judged["reasons"];
  EXPECT_FALSE(Found(scans).is_due);
  EXPECT_THAT(Ids(Found(scans)), ElementsAre()) << "the next judgement needs new sweeps";
  EXPECT_TRUE(RepeatsOf("B", scans, shelf_, now_).is_due) << "another unit";
  (void)shelf_.Reset("A");
  EXPECT_TRUE(Found(scans).is_due);
  EXPECT_NE(Found(scans).judged, "") << "what was found before can still be read";
  std::vector<Scan> again;
  for (int i = 6; i > 3; --i) again.push_back(Sweep(std::to_string(i), now_ + minutes(1)));
  (void)Judge(again);
  EXPECT_FALSE(Found(again).is_due);
}

TEST_F(SensorRepeatsTest, AThingThatMovedIsNotFit) {
  const std::vector<Scan> scans = {Sweep("3", now_, 0.02), Sweep("2", now_), Sweep("1", now_)};
  const nlohmann::json judged = Judge(scans);
  EXPECT_EQ(judged["fit"], false);
  EXPECT_FALSE(judged["reason_messages"].empty());
  shelf_.KeepRepeats("A", "{\"format\":");
  EXPECT_TRUE(Found(scans).is_due) << "damaged: as if there were none";
  EXPECT_EQ(Found(scans).judged, "");
}

}  // namespace
}  // namespace plumb
