// SPDX-License-Identifier: Apache-2.0
// The room's calibration in the store: from check scans over the board to a signed version.
#include <cmath>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/records/store.hpp"
#include "tests/support/board_checks.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using testing::CheckOver;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::MarkersOfRoom;
using testing::SceneFromRoom;
using ::testing::SizeIs;

const Actor kEve{.user = "eve", .address = "::1"};
class StoreRoomTest : public ::testing::Test {
 protected:
  void Scan(double off_m = 0, const std::string& serial = "S1") {
    store_->checks.Add(kEve, serial, CheckOver(off_m));
  }
  [[nodiscard]] RoomCandidate Candidate() { return store_->room.Candidate("S1", since_); }
  std::pair<ChangeResult, std::string> Sign(const std::string& digest) {
    try {
      return {ChangeResult::kDone, store_->room.Sign(kEve, "S1", since_, digest)};
    } catch (const StoreRefusal& refusal) {
      return {refusal.result(), refusal.what()};
    }
  }
  SignedRoom SignedAfterThreeScans() {
    Scan(), Scan(), Scan();
    (void)Sign(Candidate().digest);
    return store_->room.Newest().value();
  }

  testing::TempFolder folder_;
  WallClock::time_point since_ = WallClock::now() - std::chrono::hours(1);
  std::unique_ptr<Store> store_ = std::make_unique<Store>(folder_ / "state");
};

TEST_F(StoreRoomTest, ThreeScansAreSignedAndHoldFromThenOn) {
  EXPECT_FALSE(store_->room.Newest());
  EXPECT_THAT(Candidate().why_not.English(), HasSubstr("not been scanned"));
  Scan(), Scan();
  EXPECT_THAT(Candidate().why_not.English(), HasSubstr("2 of 3"));
  EXPECT_EQ(Sign(Candidate().digest).first, ChangeResult::kConflict);
  Scan(0.0006);
  const RoomCandidate candidate = Candidate();
  EXPECT_THAT(candidate.why_not.English(), IsEmpty());
  EXPECT_NEAR(candidate.fit->shift_m, 0.0006, 1e-6);
  EXPECT_EQ(Sign("something else").first, ChangeResult::kConflict);
  EXPECT_FALSE(store_->room.Newest());
  EXPECT_EQ(Sign(candidate.digest), std::pair(ChangeResult::kDone, std::string("1")));

  store_ = nullptr;
  store_ = std::make_unique<Store>(folder_ / "state");
  const auto room = store_->room.Newest();
  ASSERT_TRUE(room);
  EXPECT_EQ(room->version, 1);
  EXPECT_EQ(room->signed_by, "eve");
  EXPECT_EQ(room->digest, candidate.digest);
  EXPECT_EQ(room->room_markers.reference, 0);
  EXPECT_EQ(room->check_ids, (std::vector<std::string>{"3", "2", "1"}));
  const BoardFit& board = candidate.scans.at(0).scan->board;
  EXPECT_NEAR(room->fit.board_shift_m, board.shift_uncertainty_m, 1e-9);
  EXPECT_NEAR(room->fit.board_turn_rad, board.turn_uncertainty_rad, 1e-9);
  EXPECT_NEAR(room->fit.U95_m(), std::hypot(0.0006, board.shift_uncertainty_m), 1e-6);
  EXPECT_GE(room->fit.U95_rad(), board.turn_uncertainty_rad);
  // The mean of boards at 0, 0 and 0.6 mm along x.
  EXPECT_TRUE(room->fit.T_iec_reference.isApprox(
      Pose(Eigen::Translation3d(-0.0002, 0, 0)) * SceneFromRoom().inverse(), 1e-6));
  std::vector<std::string> lines;
  for (const AuditEntry& entry : store_->audit.Find({0, 10}))
    lines.push_back(entry.user + " " + entry.action + " " + entry.subject + " " +
                    entry.detail.English());
  EXPECT_THAT(lines, Contains("eve room.calibrate 1 scans differ by 0.60 mm and 0.00 deg, sha256 " +
                              candidate.digest));
  EXPECT_THAT(Candidate().scans, IsEmpty()) << "scans of before the signature are used up";
  Scan(), Scan(), Scan();
  EXPECT_EQ(Sign(Candidate().digest).first, ChangeResult::kDone);
  EXPECT_THAT(store_->audit.Find({0, 1, "room.calibrate"}).at(0).detail.English(),
              ::testing::EndsWith("; before: version 1, sha256 " + candidate.digest));
}

TEST_F(StoreRoomTest, ScansThatDifferAreNotSigned) {
  Scan(), Scan(0.00101), Scan();
  EXPECT_THAT(Candidate().why_not.English(), HasSubstr("1.01 mm"));
  EXPECT_EQ(Sign(Candidate().digest).first, ChangeResult::kConflict);
  Scan(), Scan();
  EXPECT_THAT(Candidate().why_not.English(), IsEmpty()) << "the newest three count";
}

TEST_F(StoreRoomTest, OnlyScansOfThisSensorAndTimeCount) {
  Scan(), Scan(), Scan(0, "S2");
  EXPECT_THAT(Candidate().scans, SizeIs(2));
  EXPECT_THAT(store_->room.Candidate("S1", WallClock::now() + std::chrono::hours(1)).scans,
              IsEmpty());
}

TEST_F(StoreRoomTest, AScanThatCannotBeUsedSaysWhy) {
  const auto fault = [](const TakenCheck& check) {
    return BoardScanIn(CheckJson(check))->fault.English();
  };
  EXPECT_FALSE(BoardScanIn(CheckJson(CheckOver(0, 0)))) << "no board: an ordinary check";
  EXPECT_FALSE(BoardScanIn("no json"));
  EXPECT_THAT(fault(CheckOver(0, 2)), HasSubstr("2 of the board's 4"));
  EXPECT_THAT(fault(CheckOver(0, 4, {})), HasSubstr("none of the room's markers"));
  EXPECT_THAT(fault(CheckOver(0, 4, MarkersOfRoom(), std::nullopt)), HasSubstr("reference marker"));
  EXPECT_THAT(fault(CheckOver()), IsEmpty());
}

TEST_F(StoreRoomTest, AMarkerThatMovedMakesItDue) {
  const SignedRoom room = SignedAfterThreeScans();
  const auto after = [&](double moved_m, int num_seen = 6) {
    MarkerMap markers = MarkersOfRoom();
    for (Eigen::Vector3d& corner : markers.at(4).corners) corner.x() += moved_m;
    for (int id = num_seen; id < 6; ++id) markers.erase(id);
    store_->checks.Add(kEve, "S1", CheckOver(0, 0, markers));
    return store_->room.WhyDue(room, {}).English();
  };
  EXPECT_EQ(store_->room.WhyDue(room, {}).English(), "");
  EXPECT_EQ(after(0.0049), "");
  EXPECT_EQ(after(0.0081), "marker 4 moved 8 mm since the room was calibrated");
  EXPECT_THAT(after(0, 2), HasSubstr("marker 4")) << "a check that saw too little says nothing";
  EXPECT_EQ(after(0), "") << "it was put back";
}

TEST_F(StoreRoomTest, AMarkerThatWasTurnedInItsPlaceMakesItDue) {
  const SignedRoom room = SignedAfterThreeScans();
  const auto after = [&](double turn_deg) {
    MarkerMap markers = MarkersOfRoom();
    MarkerCorners& corners = markers.at(4).corners;
    const Eigen::Vector3d centre = CentreOf(corners);
    const Eigen::AngleAxisd turn(turn_deg * kDegree, Eigen::Vector3d::UnitZ());
    for (Eigen::Vector3d& corner : corners) corner = centre + turn * (corner - centre);
    store_->checks.Add(kEve, "S1", CheckOver(0, 0, markers));
    return store_->room.WhyDue(room, {}).English();
  };
  EXPECT_EQ(after(180), "since the room was calibrated: marker 4 was turned by 180 deg");
  EXPECT_EQ(after(3), "") << "below the limit";
}

// Not "too little was seen": an older check, which agreed, does not count any more.
TEST_F(StoreRoomTest, MarkersOfWhichTooFewAgreeMakeItDueWhateverAnOlderCheckSaw) {
  const SignedRoom room = SignedAfterThreeScans();
  // The first `moved` of the six, each its own way, and `seen` of them.
  const auto after = [&](int moved, int seen = 6) {
    MarkerMap markers = MarkersOfRoom();
    for (int id = 0; id < moved; ++id) {
      for (Eigen::Vector3d& corner : markers.at(id).corners)
        corner += Eigen::Vector3d(0.05 * (id % 2 + 1), 0.03 * id * id, 0.02 * id);
    }
    for (int id = seen; id < 6; ++id) markers.erase(id);
    store_->checks.Add(kEve, "S1", CheckOver(0, 0, markers));
    return store_->room.WhyDue(room, {}).English();
  };
  EXPECT_EQ(after(0), "");
  EXPECT_EQ(after(6),
            "the 6 markers that were seen are not arranged as when the room was calibrated");
  EXPECT_EQ(after(0), "") << "they were put back";
  EXPECT_THAT(after(3, 3), HasSubstr("the 3 markers that were seen"));
  EXPECT_EQ(after(0), "");
  EXPECT_EQ(after(2, 2), "") << "two say nothing";
}

TEST_F(StoreRoomTest, ChecksCountEvenIfTheClockWasSetBackAfterTheSignature) {
  Scan(), Scan(), Scan();
  (void)Sign(Candidate().digest);
  // As if the clock had been a day ahead until after the signature.
  store_->database().ForChanges()->Execute(
      "DROP TRIGGER room_calibrations_no_update; DROP TRIGGER checks_no_update; UPDATE "
      "room_calibrations SET signed_at = "
      "signed_at + 86400000000; UPDATE checks SET time = time + 86400000000");
  store_ = nullptr;
  store_ = std::make_unique<Store>(folder_ / "state");
  const SignedRoom room = *store_->room.Newest();
  MarkerMap markers = MarkersOfRoom();
  for (Eigen::Vector3d& corner : markers.at(4).corners) corner.x() += 0.02;
  store_->checks.Add(kEve, "S1", CheckOver(0, 0, markers));
  EXPECT_THAT(store_->room.WhyDue(room, {}).English(), HasSubstr("marker 4 moved 20 mm"));
  EXPECT_THAT(Candidate().scans, IsEmpty()) << "the signed scans are not used again";
  Scan(), Scan(), Scan();
  const RoomCandidate candidate = Candidate();
  EXPECT_THAT(candidate.why_not.English(), IsEmpty()) << "the room can be calibrated again";
  EXPECT_EQ(Sign(candidate.digest), std::pair(ChangeResult::kDone, std::string("2")));
}

TEST_F(StoreRoomTest, OneThatWasTamperedWithIsNotUsed) {
  Scan(), Scan(), Scan();
  (void)Sign(Candidate().digest);
  {
    const StoreDatabase::Held direct = store_->database().ForChanges();
    EXPECT_ANY_THROW(direct->Execute("UPDATE room_calibrations SET signed_by = 'x'"));
    EXPECT_ANY_THROW(direct->Execute("DELETE FROM room_calibrations"));
    direct->Execute(
        "DROP TRIGGER room_calibrations_no_update; UPDATE room_calibrations SET json = "
        "replace(json, '\"shift_m\":', '\"shift_m\":1')");
  }
  store_ = nullptr;
  store_ = std::make_unique<Store>(folder_ / "state");
  EXPECT_THROW((void)store_->room.Newest(), DataError);
  EXPECT_THAT(store_->room.List(10), IsEmpty());
}

}  // namespace
}  // namespace plumb
