// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/room_board.hpp"

#include <cmath>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace plumb {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr int kSize = 250;
constexpr double kLength_m = 0.104;

// From the board, which is the room's frame, to the scan's.
Pose PoseOfScan(double turn = 0.7) {
  return Pose(Eigen::Translation3d(0.4, -0.9, 0.2) *
              Eigen::AngleAxisd(turn, Eigen::Vector3d(0.1, -0.2, 1).normalized()));
}

SceneMarker MarkerAt(const Eigen::Vector3d& centre, const Pose& T_scene_room, double size = 1) {
  SceneMarker marker;
  marker.corners = CornersInMarkerFrame(kLength_m);
  for (Eigen::Vector3d& corner : marker.corners) corner = T_scene_room * (size * (corner + centre));
  marker.num_views = 10;
  return marker;
}

// The board as a sweep sees it, printed at `size`.
MarkerMap SeenBoard(const Pose& T_scene_board, double size = 1) {
  MarkerMap seen;
  for (const auto& [id, centre] : MakeRoomBoard(kSize, kLength_m).centres_m)
    seen.emplace(id, MarkerAt({centre.x(), centre.y(), 0}, T_scene_board, size));
  return seen;
}

MarkerMap SeenRoom(const Pose& T_scene_room) {
  MarkerMap seen;
  for (int id = 0; id < 6; ++id)
    seen.emplace(
        id, MarkerAt({-0.6 + 0.6 * (id % 3), id < 3 ? -0.8 : 0.8, 0.1 * (id % 2)}, T_scene_room));
  return seen;
}

std::variant<BoardFit, Message> Fit(const MarkerMap& seen) {
  return FitRoomBoard(MakeRoomBoard(kSize, kLength_m), seen);
}

BoardFit FitOf(const MarkerMap& seen) {
  const auto fit = Fit(seen);
  if (const auto* why = std::get_if<Message>(&fit)) {
    ADD_FAILURE() << why->English();
    return {};
  }
  return std::get<BoardFit>(fit);
}

std::string WhyNot(const MarkerMap& seen) {
  const auto fit = Fit(seen);
  const auto* why = std::get_if<Message>(&fit);
  return why != nullptr ? why->English() : "";
}

// A scan whose board lies a little off where it lay: `off` in the board's own frame.
RoomScan ScanWith(const Pose& T_scene_room, const Pose& off = Pose::Identity()) {
  return {.room = SeenRoom(T_scene_room), .board = FitOf(SeenBoard(T_scene_room * off))};
}

RoomFit RoomFrom(const std::vector<RoomScan>& scans) {
  const auto fit = FitRoom(scans);
  if (const auto* why = std::get_if<Message>(&fit)) {
    ADD_FAILURE() << why->English();
    return {};
  }
  return std::get<RoomFit>(fit);
}

TEST(RoomBoardTest, LiesOnA3ForTheUsualMarkersAndOnA4ForSmallOnes) {
  const RoomBoard board = MakeRoomBoard(kSize, kLength_m);
  EXPECT_TRUE(board.is_a3);
  EXPECT_FALSE(MakeRoomBoard(kSize, 0.06).is_a3);
  ASSERT_EQ(board.centres_m.size(), 4U);
  EXPECT_EQ(board.centres_m.begin()->first, 246);
  // The first one lies at the top left.
  EXPECT_LT(board.centres_m.at(246).x(), 0);
  EXPECT_GT(board.centres_m.at(246).y(), 0);
  EXPECT_THAT(std::string(MakeRoomBoard(kSize, 0.105).is_a3 ? "A3" : "A4"), "A3");
  EXPECT_THROW((void)MakeRoomBoard(kSize, 0.106), std::invalid_argument);
  EXPECT_THROW((void)MakeRoomBoard(kSize, 0.009), std::invalid_argument);
  EXPECT_THROW((void)MakeRoomBoard(3, kLength_m), std::invalid_argument);
}

TEST(RoomBoardTest, FindsTheBoardWhereItLies) {
  const BoardFit fit = FitOf(SeenBoard(PoseOfScan()));
  EXPECT_TRUE(fit.T_scene_board.isApprox(PoseOfScan(), 1e-9));
  EXPECT_EQ(fit.num_markers, 4U);
  EXPECT_NEAR(fit.rms_m, 0, 1e-9);
  EXPECT_NEAR(fit.scale, 1, 1e-9);
  EXPECT_GT(fit.shift_uncertainty_m, 0);
  EXPECT_LT(fit.shift_uncertainty_m, 2 * kMillimetre);
  EXPECT_GT(fit.turn_uncertainty_rad, 0);
  EXPECT_LT(fit.turn_uncertainty_rad, 1.5 * kDegree);
}

TEST(RoomBoardTest, NeedsThreeOfItsMarkers) {
  MarkerMap seen = SeenBoard(PoseOfScan());
  seen.erase(246);
  EXPECT_TRUE(FitOf(seen).T_scene_board.isApprox(PoseOfScan(), 1e-9));
  seen.erase(247);
  seen.emplace(3, MarkerAt({0, 0, 0}, PoseOfScan()));  // the room's does not count
  EXPECT_THAT(WhyNot(seen), HasSubstr("2 of the board's 4 markers"));
}

TEST(RoomBoardTest, RefusesASheetOfAnotherScale) {
  EXPECT_THAT(WhyNot(SeenBoard(PoseOfScan(), 1.0099)), IsEmpty());
  EXPECT_THAT(WhyNot(SeenBoard(PoseOfScan(), 1.0101)), HasSubstr("print it at 100 %"));
  EXPECT_THAT(WhyNot(SeenBoard(PoseOfScan(), 0.9901)), IsEmpty());
  EXPECT_THAT(WhyNot(SeenBoard(PoseOfScan(), 0.9899)), HasSubstr("print it at 100 %"));
}

// A turn about its own centre by the angle a moves each corner of a marker by a times half its
// diagonal, but not its centre: the scale stays, and the whole fit cannot follow four that turn
// against each other.
TEST(RoomBoardTest, RefusesABoardThatDoesNotFit) {
  const auto turned = [](double rms_m) {
    const double angle = rms_m / (kLength_m / std::sqrt(2.0));
    MarkerMap seen;
    int sign = 1;
    for (const auto& [id, centre] : MakeRoomBoard(kSize, kLength_m).centres_m) {
      const Pose T(Eigen::Translation3d(centre.x(), centre.y(), 0) *
                   Eigen::AngleAxisd(sign * angle, Eigen::Vector3d::UnitZ()));
      seen.emplace(id, MarkerAt({0, 0, 0}, PoseOfScan() * T));
      sign = id == 246 || id == 248 ? -1 : 1;
    }
    return seen;
  };
  EXPECT_THAT(WhyNot(turned(1.98 * kMillimetre)), IsEmpty());
  EXPECT_THAT(WhyNot(turned(2.02 * kMillimetre)), HasSubstr("off their places on the sheet"));
}

TEST(RoomBoardTest, RefusesWhatIsNotFinite) {
  MarkerMap seen = SeenBoard(PoseOfScan());
  seen.at(247).corners[2].x() = std::nan("");
  EXPECT_THAT(WhyNot(seen), testing::Not(IsEmpty()));
}

TEST(RoomFitTest, FindsTheRoomFromScansOfDifferentFrames) {
  const std::vector<RoomScan> scans = {ScanWith(PoseOfScan(0.7)), ScanWith(PoseOfScan(-1.2)),
                                       ScanWith(PoseOfScan(2.9))};
  const RoomFit fit = RoomFrom(scans);
  EXPECT_TRUE(fit.T_iec_reference.isApprox(PoseOfScan(0.7).inverse(), 1e-6));
  EXPECT_NEAR(fit.shift_m, 0, 1e-6);
  EXPECT_NEAR(fit.turn_rad, 0, 1e-6);
  EXPECT_TRUE(WhyNotSign(fit, scans.size()).empty());
  EXPECT_THAT(WhyNotSign(fit, 2).English(), HasSubstr("2 of 3 scans"));
  // The room's markers keep their poses in the room, whatever coordinate frame another scan has.
  EXPECT_TRUE(
      fit.markers_iec.at(5).corners[0].isApprox(SeenRoom(Pose::Identity()).at(5).corners[0], 1e-6));
  const auto T = RoomOf(fit.markers_iec, SeenRoom(PoseOfScan(0.1)));
  ASSERT_TRUE(T.has_value());
  EXPECT_TRUE(T->isApprox(PoseOfScan(0.1).inverse(), 1e-6));
}

TEST(RoomFitTest, TakesTheMeanOfTheBoard) {
  const Pose left(Eigen::Translation3d(-0.0003, 0, 0)), right(Eigen::Translation3d(0.0003, 0, 0));
  const RoomFit fit = RoomFrom(
      {ScanWith(PoseOfScan(), left), ScanWith(PoseOfScan()), ScanWith(PoseOfScan(), right)});
  EXPECT_TRUE(fit.T_iec_reference.isApprox(PoseOfScan().inverse(), 1e-6));
  EXPECT_NEAR(fit.shift_m, 0.0006, 1e-6);
}

TEST(RoomFitTest, IsNotSignedWhereScansDiffer) {
  const auto why = [](double shift_mm, double turn_deg) {
    const Pose off(Eigen::Translation3d(0, shift_mm * kMillimetre, 0) *
                   Eigen::AngleAxisd(turn_deg * kDegree, Eigen::Vector3d::UnitZ()));
    return WhyNotSign(RoomFrom({ScanWith(PoseOfScan()), ScanWith(PoseOfScan(), off),
                                ScanWith(PoseOfScan())}),
                      3)
        .English();
  };
  EXPECT_THAT(why(0.99, 0), IsEmpty());
  EXPECT_THAT(why(1.01, 0), HasSubstr("the scans differ by 1.01 mm"));
  EXPECT_THAT(why(0, 0.199), IsEmpty());
  EXPECT_THAT(why(0, 0.201), HasSubstr("0.20 deg"));
}

TEST(RoomFitTest, RefusesScansWhoseRoomMarkersDisagree) {
  RoomScan other = ScanWith(PoseOfScan());
  other.room.erase(0), other.room.erase(1), other.room.erase(2), other.room.erase(3);
  const auto fit = FitRoom(std::vector{ScanWith(PoseOfScan()), other});
  ASSERT_TRUE(std::holds_alternative<Message>(fit));
  EXPECT_THAT(std::get<Message>(fit).English(), HasSubstr("fewer than 3"));
  EXPECT_FALSE(RoomOf(ScanWith(PoseOfScan()).room, other.room).has_value());
  EXPECT_THROW((void)FitRoom({}), std::invalid_argument);
}

TEST(RoomBoardTest, TellsTheBoardFromTheRoom) {
  MarkerMap seen = SeenBoard(PoseOfScan());
  seen.emplace(245, MarkerAt({0, 0, 0}, PoseOfScan()));
  const auto [board, room] = SplitRoomBoard(seen, kSize);
  EXPECT_EQ(board.size(), 4U);
  ASSERT_EQ(room.size(), 1U);
  EXPECT_EQ(room.begin()->first, 245);
}

TEST(RoomBoardTest, ASingleMarkerOfSuchANumberIsOneOfTheRoom) {
  MarkerMap seen;
  const auto ids = RoomBoardIds(kSize);
  seen.emplace(ids[2], MarkerAt({0, 0, 0}, PoseOfScan()));
  EXPECT_EQ(SplitRoomBoard(seen, kSize).first.size(), 0U);
  EXPECT_EQ(SplitRoomBoard(seen, kSize).second.size(), 1U);
  seen.emplace(ids[0], MarkerAt({0.2, 0, 0}, PoseOfScan()));
  EXPECT_EQ(SplitRoomBoard(seen, kSize).first.size(), 2U);
  EXPECT_EQ(SplitRoomBoard(seen, kSize).second.size(), 0U);
}

}  // namespace
}  // namespace plumb
