// SPDX-License-Identifier: Apache-2.0
// Scans of a still wall: how they end, and what they report meanwhile.
#include "daemon/scanning/scan_session.hpp"

#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <future>
#include <mutex>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/appliance/room_in_use.hpp"
#include "daemon/files/scene_folder.hpp"
#include "tests/support/fake_sensor.hpp"
#include "tests/support/temp_folder.hpp"
#include "words/room.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using testing::FakeBus;
using ::testing::HasSubstr;
using ::testing::Not;
using Kind = EndedScan::Kind;

class ScanSessionTest : public ::testing::Test {
 protected:
  ScanSessionTest() {
    job_.info = FakeBus::Info();
    job_.stop_after_s = 1000;
    callbacks_.begin = [this] { return folder_.path(); };
    callbacks_.save = [this](const EndedScan& outcome) { saved_.push_back(outcome.kind); };
    callbacks_.update = [](const ScanUpdate&) {};
    callbacks_.sweep_complete = [this] { ++num_complete_; };
    callbacks_.ended = [this](const EndedScan& outcome) {
      const std::lock_guard lock(mutex_);
      outcome_ = outcome;
      changed_.notify_all();
    };
  }

  void Start() { session_ = std::make_unique<ScanSession>(job_, callbacks_); }
  void Push(int num_frames) {
    for (int i = 0; i < num_frames; ++i) session_->feed()->Push(FakeBus::Wall(next_++));
  }
  /// The sweep continues until it is stopped; the feed is not closed.
  void PushUntilTheEnd() {
    const auto has_ended = [&] {
      const std::lock_guard lock(mutex_);
      return outcome_.has_value();
    };
    for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
         !has_ended() && std::chrono::steady_clock::now() < end;) {
      Push(1);
    }
  }
  EndedScan WaitForEnd() {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, std::chrono::seconds(60), [&] {
      return outcome_.has_value();
    })) << "the scan did not end";
    return outcome_.value_or(EndedScan{});
  }

  testing::TempFolder folder_;
  ScanJob job_;
  ScanCallbacks callbacks_;
  std::vector<Kind> saved_;
  int num_complete_ = 0;
  int next_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<EndedScan> outcome_;
  std::unique_ptr<ScanSession> session_;
};

// What is stated of the lasers stays apart from what the calibrations found of themselves: nothing
// stated is not exact.
TEST(TakeOtherRoomTest, BothRoomsCalibrationsAreInTheIntervalsBesideTheLasers) {
  ImportedRoom elsewhere{.unit = "plumb-a", .version = 2, .room = SignedRoom{}};
  elsewhere.room->fit.markers_iec = {{4, {}}};
  elsewhere.room->fit.shift_m = 0.004;
  elsewhere.room->fit.board_shift_m = 0.003;
  elsewhere.room->fit.turn_rad = 0.0012;
  elsewhere.room->fit.board_turn_rad = 0.0005;
  const RoomAxes here{
      .version = 7, .markers_iec = {{5, {}}}, .why_not = {}, .u95_m = 0.012, .u95_rad = 0.002};
  CompareOptions compare;
  compare.iec_u95_m = 0.003;
  const auto used = TakeOtherRoom(elsewhere, here, compare);
  ASSERT_TRUE(used);
  EXPECT_EQ(used->version, 7);
  ASSERT_TRUE(compare.reference_room);
  EXPECT_TRUE(compare.reference_room->markers.contains(4));
  EXPECT_TRUE(compare.room_markers.contains(5));
  EXPECT_EQ(compare.reference_room->u95_m, 0.003);
  EXPECT_FALSE(compare.reference_room->u95_rad);
  EXPECT_NEAR(compare.reference_room->calibration_u95_m, 0.005, 1e-12);
  EXPECT_NEAR(compare.reference_room->calibration_u95_rad, 0.0013, 1e-12);
  EXPECT_EQ(compare.iec_u95_m, 0.003);
  EXPECT_FALSE(compare.iec_u95_rad);
  EXPECT_EQ(compare.calibration_u95_m, 0.012);
  EXPECT_EQ(compare.calibration_u95_rad, 0.002);
}

TEST(TakeOtherRoomTest, WithoutACalibrationOnEitherSideThereIsNoAnswer) {
  Scene reference;
  reference.frame = SceneFrame::kReferenceMarker;
  reference.height_map.emplace();
  const auto reason = [&](const ImportedRoom& elsewhere, const std::optional<RoomAxes>& here) {
    CompareOptions compare;
    compare.T_iec_reference = Pose::Identity();  // what the configuration says does not do
    EXPECT_FALSE(TakeOtherRoom(elsewhere, here, compare) && elsewhere.room);
    const Comparison refused = Compare(reference, Scene{}, compare);
    EXPECT_EQ(refused.verdict, Verdict::kNoAnswer);
    return refused.reasons.empty() ? std::string() : refused.reasons.front().English();
  };
  const RoomAxes here{.version = 1, .markers_iec = {{5, {}}}, .why_not = {}};
  const ImportedRoom unknown{
      .unit = {}, .version = 0, .room = {}, .why_not = Message::Verbatim("not calibrated there")};
  EXPECT_NE(reason(unknown, here).find("not calibrated there"), std::string::npos);
  EXPECT_NE(reason(unknown, std::nullopt), "");
  CompareOptions compare;
  EXPECT_FALSE(
      TakeOtherRoom({.unit = "a", .version = 1, .room = SignedRoom{}}, std::nullopt, compare));
  EXPECT_EQ(compare.why_no_room, say::room::ElsewhereNeedsCalibration());
  EXPECT_FALSE(compare.T_iec_reference);
  RoomAxes old = here;
  old.too_old = Message::Verbatim("401 days");
  EXPECT_FALSE(TakeOtherRoom({.unit = "a", .version = 1, .room = SignedRoom{}}, old, compare));
  EXPECT_EQ(compare.why_no_room, old.too_old);
  EXPECT_FALSE(compare.T_iec_reference);
}

TEST(RoomAgeTest, ACalibrationIsTooOldAfterItsDaysAndNeverWhereNoneAreStated) {
  const WallClock::time_point signed_at{};
  const auto after = [&](int hours) {
    return WhyTooOld(signed_at, signed_at + std::chrono::hours(hours), 400).English();
  };
  EXPECT_EQ(after(400 * 24), "");
  EXPECT_THAT(after(400 * 24 + 1), HasSubstr("400 days old"));
  EXPECT_EQ(after(-24), "");
  EXPECT_TRUE(WhyTooOld(signed_at, signed_at + std::chrono::hours(24 * 5000), 0).empty());

  ImportedRoom elsewhere{.unit = "plumb-a", .version = 1, .room = SignedRoom{}};
  elsewhere.room->signed_at = signed_at;
  const auto there_after = [&](int hours) {
    return UnlessTooOld(elsewhere, signed_at + std::chrono::hours(hours), 400);
  };
  EXPECT_TRUE(there_after(400 * 24)->room);
  EXPECT_FALSE(there_after(400 * 24 + 1)->room);
  EXPECT_THAT(there_after(400 * 24 + 1)->why_not.English(),
              AllOf(HasSubstr("plumb-a"), HasSubstr("400 days old")));
}

TEST(TakeRoomTest, APlanningCtIsMetByTheRoomsMarkersWithTheSpreadOfTheCalibration) {
  Scene planned;
  planned.planning.emplace();
  planned.frame = SceneFrame::kIec;
  CompareOptions compare;
  compare.isocentre_m = Eigen::Vector3d(1, 2, 3);
  compare.T_iec_reference = Pose::Identity();
  compare.iec_u95_m = 0.003;
  RoomAxes room{
      .version = 7, .markers_iec = {{5, {}}}, .why_not = {}, .u95_m = 0.004, .u95_rad = 0.001};
  const auto used = TakeRoom(room, planned, compare);
  ASSERT_TRUE(used.has_value());
  EXPECT_TRUE(used->why_not_used.empty());
  EXPECT_FALSE(compare.isocentre_m) << "the origin of its frame";
  EXPECT_TRUE(compare.room_markers.contains(5));
  EXPECT_EQ(compare.iec_u95_m, 0.003);
  EXPECT_FALSE(compare.iec_u95_rad) << "nothing stated is not exact";
  EXPECT_EQ(compare.calibration_u95_m, 0.004);
  EXPECT_EQ(compare.calibration_u95_rad, 0.001);

  CompareOptions without;
  EXPECT_FALSE(TakeRoom(std::nullopt, planned, without));
  EXPECT_EQ(without.why_no_room, say::room::NoneForPlan()) << "no key of a file";
  without = {};
  without.T_iec_reference = Pose::Identity();
  EXPECT_FALSE(TakeRoom(std::nullopt, planned, without));
  EXPECT_TRUE(without.why_no_room.empty()) << "the configuration says where the room lies";

  RoomAxes old = room;
  old.too_old = Message::Verbatim("401 days");
  CompareOptions with_old;
  EXPECT_THAT(TakeRoom(old, planned, with_old)->why_not_used.English(), HasSubstr("401 days"));
  EXPECT_FALSE(with_old.T_iec_reference);
  EXPECT_THAT(with_old.why_no_room.English(), HasSubstr("401 days"));

  room.why_not = Message::Verbatim("marker 5 moved");
  (void)TakeRoom(room, planned, compare);
  EXPECT_FALSE(compare.T_iec_reference);
  planned.height_map.emplace();
  const Comparison refused = Compare(planned, Scene{}, compare);
  EXPECT_EQ(refused.verdict, Verdict::kNoAnswer);
  ASSERT_FALSE(refused.reasons.empty());
  EXPECT_THAT(refused.reasons.front().English(), HasSubstr("marker 5 moved"));
}

TEST_F(ScanSessionTest, ClosingTheFeedEndsTheSweepWithEveryFrameThatWaited) {
  Start();
  Push(12);
  session_->feed()->Close();
  const EndedScan outcome = WaitForEnd();
  EXPECT_EQ(outcome.kind, Kind::kDone) << outcome.reason.English();
  EXPECT_EQ(outcome.frames, 12);
  EXPECT_EQ(outcome.frames_dropped, 0);
  EXPECT_THAT(saved_, ElementsAre(Kind::kDone));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "scene" / "scene.json"));
}

TEST_F(ScanSessionTest, WhatIsKnownOfTheSensorReachesTheSceneAndAScanWithoutMarkersTeachesNothing) {
  auto shelf = std::make_shared<ProfileShelf>(folder_ / "profiles");
  SensorProfile known = ProfileOfAnyUnit(job_.info.intrinsics);
  known.num_sweeps = 4;
  (void)shelf->Add("A", known);
  const auto scan_with = [&](const char* serial) {
    job_.unit_profile = std::make_shared<UnitProfile>(shelf, serial, job_.info.intrinsics);
    outcome_.reset();
    Start();
    Push(12);
    session_->feed()->Close();
    const EndedScan outcome = WaitForEnd();
    EXPECT_EQ(outcome.kind, Kind::kDone) << outcome.reason.English();
    EXPECT_THAT(outcome.why_not_learned.English(), HasSubstr("0 markers"));
    const Scene scene = ReadScene(folder_ / "scene");
    EXPECT_EQ(scene.sensor_profile.value_or(""),
              serial == std::string("A") ? "A version 1, 4 sweeps" : "");
  };
  scan_with("A");
  scan_with("B");
  EXPECT_EQ(shelf->Versions("A").size(), 1U);
  EXPECT_TRUE(shelf->Versions("B").empty());
}

// Whoever acts on a result, or reads its report, learns that its sensor has changed.
TEST_F(ScanSessionTest, AUnitThatNoLongerAgreesWithItsProfileIsAWarningOfTheResult) {
  auto shelf = std::make_shared<ProfileShelf>(folder_ / "profiles");
  SensorProfile known = ProfileOfAnyUnit(job_.info.intrinsics);
  known.covariance(kLensAt, kLensAt) = 1e-8;
  known.num_sweeps = 4;
  (void)shelf->Add("A", known);
  const auto warnings = [&](bool has_drifted) {
    const auto profile = std::make_shared<UnitProfile>(shelf, "A", job_.info.intrinsics);
    ReconstructorOptions as_the_sweep;
    profile->Begin(as_the_sweep);
    job_.unit_profile = profile;
    callbacks_.update = [&](const ScanUpdate&) {
      SensorProfile learned = *as_the_sweep.profile;
      learned.covariance(kLensAt, kLensAt) = 0.5e-8;
      if (has_drifted) learned.mean[kLensAt] += 0.01;
      as_the_sweep.on_learned(learned);
    };
    outcome_.reset();
    std::filesystem::remove_all(folder_ / "result");
    Start();
    Push(12);
    session_->feed()->Close();
    const EndedScan outcome = WaitForEnd();
    EXPECT_EQ(outcome.kind, Kind::kDone) << outcome.reason.English();
    EXPECT_EQ(outcome.drift.empty(), !has_drifted);
    session_.reset();  // nothing calls back any more
    return outcome.result_json;
  };
  EXPECT_EQ(warnings(true), "") << "no reference, no result";
  std::filesystem::rename(folder_ / "scene", folder_ / "reference");
  job_.reference_scene = folder_ / "reference";
  EXPECT_THAT(warnings(true), HasSubstr("no longer agrees with its profile"));
  EXPECT_THAT(warnings(false), Not(HasSubstr("no longer agrees with its profile")));
}

TEST_F(ScanSessionTest, ACheckThatIsDiscardedAsItFailsIsNotAFailedCheck) {
  std::promise<void> started;
  bool cancels = false;
  std::vector<bool> has_check;
  callbacks_.save = [&](const EndedScan& outcome) {
    has_check.push_back(outcome.check.has_value());
  };
  callbacks_.begin = [&]() -> std::filesystem::path {
    started.get_future().wait();
    if (cancels) session_->Cancel();
    throw DataError(Message::Verbatim("no depth"));
  };
  job_.check.emplace();
  const auto ended = [&] {
    started = std::promise<void>();
    outcome_.reset();
    Start();
    started.set_value();
    return WaitForEnd().kind;
  };
  EXPECT_EQ(ended(), Kind::kNoScene);
  cancels = true;
  EXPECT_EQ(ended(), Kind::kCancelled);
  EXPECT_THAT(has_check, ElementsAre(true, false));
}

TEST_F(ScanSessionTest, FramesThatTrackingIsTooLateForAreDroppedAndCounted) {
  job_.queue_capacity = 2;
  std::mutex gate;
  gate.lock();
  callbacks_.begin = [&] {
    const std::lock_guard wait(gate);  // tracking does not begin before all frames are there
    return folder_.path();
  };
  Start();
  Push(10);
  gate.unlock();
  session_->feed()->Close();
  const EndedScan outcome = WaitForEnd();
  EXPECT_EQ(outcome.frames, 2);
  EXPECT_EQ(outcome.frames_dropped, 8);
}

TEST_F(ScanSessionTest, CancelledItLeavesNothingButItsEnd) {
  Start();
  Push(3);
  session_->Cancel();
  EXPECT_EQ(WaitForEnd().kind, Kind::kCancelled);
  EXPECT_THAT(saved_, ElementsAre(Kind::kCancelled));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "scene"));
}

TEST_F(ScanSessionTest, DestroyedItCancelsAndWaits) {
  Start();
  Push(3);
  session_.reset();
  EXPECT_EQ(outcome_->kind, Kind::kCancelled);
}

TEST_F(ScanSessionTest, NoFramesAreNoSceneWithAReason) {
  Start();
  session_->feed()->Close();
  const EndedScan outcome = WaitForEnd();
  EXPECT_EQ(outcome.kind, Kind::kNoScene);
  EXPECT_NE(outcome.reason.English(), "");
}

TEST_F(ScanSessionTest, AReferenceWithoutItsMarkerIsNoneAndSaysWhatToDo) {
  job_.is_reference = true;
  Start();
  Push(12);
  session_->feed()->Close();
  const EndedScan outcome = WaitForEnd();
  EXPECT_EQ(outcome.kind, Kind::kNoScene);
  EXPECT_THAT(outcome.reason.English(), HasSubstr("reference marker"));
}

TEST_F(ScanSessionTest, AFrameOfTheWrongSizeEndsTheScanAndNotTheProcess) {
  Start();
  Frame wrong = FakeBus::Wall(0);
  wrong.depth_m = cv::Mat(60, 80, CV_32FC1, cv::Scalar(1.0));
  session_->feed()->Push(wrong);
  EXPECT_EQ(WaitForEnd().kind, Kind::kNoScene);
}

TEST_F(ScanSessionTest, AStoreThatRefusesFailsTheScanAndIsToldOfTheFailure) {
  callbacks_.save = [this](const EndedScan& outcome) {
    saved_.push_back(outcome.kind);
    if (outcome.kind == Kind::kDone) throw IoError("the disk is full");
  };
  Start();
  Push(12);
  session_->feed()->Close();
  const EndedScan outcome = WaitForEnd();
  EXPECT_EQ(outcome.kind, Kind::kFailed);
  EXPECT_EQ(outcome.reason.English(), "the disk is full");
  EXPECT_THAT(saved_, ElementsAre(Kind::kDone, Kind::kFailed));
}

TEST_F(ScanSessionTest, AStoreThatDoesNotEvenBeginFailsTheScan) {
  callbacks_.begin = []() -> std::filesystem::path { throw IoError("read-only disk"); };
  Start();
  EXPECT_EQ(WaitForEnd().kind, Kind::kFailed);
  EXPECT_EQ(outcome_->reason.English(), "read-only disk");
}

TEST_F(ScanSessionTest, AReferenceThatCannotBeReadEndsTheSweepAsAFault) {
  job_.reference_scene = folder_ / "nowhere";
  Start();
  PushUntilTheEnd();
  const EndedScan outcome = WaitForEnd();
  EXPECT_EQ(outcome.kind, Kind::kFailed) << "another sweep would not help";
  EXPECT_THAT(outcome.reason.English(),
              ::testing::AllOf(HasSubstr("nowhere"), HasSubstr("backup")));
  EXPECT_THAT(saved_, ElementsAre(Kind::kFailed));
}

TEST_F(ScanSessionTest, AReferenceThatIsNotWhatWasStoredGivesNoVerdict) {
  job_.reference_scene = folder_ / "000007" / "scene";
  job_.check_reference = [](const std::stop_token&) {
    return Message::Verbatim("scene/cloud.ply has been changed");
  };
  Start();
  PushUntilTheEnd();
  const EndedScan outcome = WaitForEnd();
  EXPECT_EQ(outcome.kind, Kind::kFailed);
  EXPECT_FALSE(outcome.verdict);
  EXPECT_THAT(outcome.reason.English(),
              ::testing::AllOf(HasSubstr("scene/cloud.ply has been changed"), HasSubstr("000007"),
                               HasSubstr("backup")));
}

TEST_F(ScanSessionTest, AFailedSweepLeavesItsWholeRecording) {
  job_.keep_recording = true;
  job_.queue_capacity = 100;
  job_.reference_scene = folder_ / "nowhere";
  Start();
  PushUntilTheEnd();
  EXPECT_EQ(WaitForEnd().kind, Kind::kFailed);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "recording" / "rgb.txt"));
}

TEST_F(ScanSessionTest, TheSweepIsCompleteOnceWhenNothingNewIsSeenForLongEnough) {
  job_.stop_after_s = 1.0;
  job_.queue_capacity = 100;
  Start();
  Push(75);  // two and a half seconds of the same wall
  session_->feed()->Close();
  (void)WaitForEnd();
  EXPECT_EQ(num_complete_, 1);
}

TEST_F(ScanSessionTest, ADiscardedRecordingIsNotWrittenToItsEnd) {
  job_.keep_recording = true;
  job_.queue_capacity = 100;
  Start();
  Push(60);
  session_->Cancel();
  EXPECT_EQ(WaitForEnd().kind, Kind::kCancelled);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "recording" / "camera.yaml")) << "written last";
}

TEST_F(ScanSessionTest, ARecordingThatCannotBeWrittenEndsTheSweepWithItsReason) {
  job_.keep_recording = true;
  callbacks_.begin = [this] {
    std::filesystem::create_directories(folder_ / "recording" / "rgb" /
                                        "0.000000.png");  // where the first image is to be written
    return folder_.path();
  };
  std::promise<void> first_frame;  // none is dropped before it
  callbacks_.update = [&, is_told = false](const ScanUpdate&) mutable {
    if (!std::exchange(is_told, true)) first_frame.set_value();
  };
  Start();
  Push(1);
  first_frame.get_future().wait();
  PushUntilTheEnd();
  EXPECT_EQ(WaitForEnd().kind, Kind::kFailed);
  EXPECT_THAT(outcome_->reason.English(), HasSubstr("0.000000.png"));
}

TEST_F(ScanSessionTest, ARecordingHoldsWhatTrackingTook) {
  job_.keep_recording = true;
  Start();
  Push(9);
  session_->feed()->Close();
  EXPECT_EQ(WaitForEnd().kind, Kind::kDone) << outcome_->reason.English();
  EXPECT_TRUE(std::filesystem::exists(folder_ / "recording" / "camera.yaml"));
  int num_images = 0;
  for ([[maybe_unused]] const auto& entry :
       std::filesystem::directory_iterator(folder_ / "recording" / "depth"))
    ++num_images;
  EXPECT_EQ(num_images, 9);
}

}  // namespace
}  // namespace plumb
