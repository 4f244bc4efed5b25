// SPDX-License-Identifier: Apache-2.0
// Comparisons with a planning CT.
#include "algo/comparison/planned_reference.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "algo/base/units.hpp"
#include "algo/comparison/comparison.hpp"
#include "algo/comparison/deviation.hpp"
#include "algo/monitoring/monitor.hpp"
#include "tests/support/synthetic_scene.hpp"
#include "words/comparison.hpp"

namespace plumb {
namespace {

using test::BodyMotionAbout;
using test::BodyShape;
using test::MakeSyntheticScene;
using test::SyntheticOptions;
using testing::Contains;
using testing::Not;
using testing::Truly;

auto Says(const MessageId& id) {
  return Contains(Truly([id](const Message& message) { return message.Is(id); }));
}

SyntheticOptions PlacedBody() {
  SyntheticOptions options;
  options.T_reference_body =
      Pose(Eigen::Translation3d(0.6, 0.45, 0) * Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ()));
  return options;
}

// The room: the isocentre lies in the body, the head points to the gantry.
Pose RoomPose() {
  Eigen::Matrix3d R;
  R << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  Pose T = Pose::Identity();
  T.linear() = Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitZ()).toRotationMatrix() * R;
  T.translation() = -(T.linear() * Eigen::Vector3d(0.62, 0.43, 0.1));
  return T;
}

// The body alone, as a CT would show it.
Scene Planned() {
  const Scene scan = MakeSyntheticScene(PlacedBody());
  const Pose T_iec = RoomPose();
  Scene planned;
  planned.frame = SceneFrame::kIec;
  planned.planning.emplace();
  planned.planning->support_m = (T_iec * Eigen::Vector3d::Zero()).z();
  planned.planning->slice_spacing_m = 0.003;
  for (std::size_t i = 0; i < scan.cloud.size(); ++i) {
    if (scan.cloud.points[i].z() < 0.02F || scan.cloud.normals[i].z() < 0.15F) continue;
    planned.cloud.points.push_back((T_iec * scan.cloud.points[i].cast<double>()).cast<float>());
    planned.cloud.normals.push_back(
        (T_iec.linear() * scan.cloud.normals[i].cast<double>()).cast<float>());
  }
  planned.height_map =
      HeightMapOfCloud(planned.cloud, 0.004,
                       {.x_min = -0.3, .y_min = -0.45, .step = 0.002, .width = 300, .height = 450});
  return planned;
}

const Scene& PlannedScene() {
  static const Scene scene = Planned();
  return scene;
}

Scene Current(const Pose& T_motion, SyntheticOptions options = PlacedBody()) {
  options.seed += 7;
  options.T_reference_body = T_motion * options.T_reference_body;
  return MakeSyntheticScene(options);
}

Pose SmallMotion() {
  return BodyMotionAbout({0.6, 0.45, 0.1}, {0.012, -0.008, 0.004}, 2.0, 0.5, -1.0);
}

CompareOptions InRoom() {
  CompareOptions options;
  options.T_iec_reference = RoomPose();
  options.iec_u95_m = 0.001;
  options.iec_u95_rad = 0.1 * kDegree;
  return options;
}

TEST(PlannedReferenceTest, TheMotionIsThatOfTheBodyInTheMarkersFrame) {
  const Comparison comparison = Compare(PlannedScene(), Current(SmallMotion()), InRoom());
  ASSERT_TRUE(comparison.motion && comparison.correction);
  const Eigen::Vector3d body(0.6, 0.45, 0.1);
  EXPECT_LT((comparison.motion->T * body - SmallMotion() * body).norm(), 0.3 * kMillimetre);
  EXPECT_LT(RotationAngle(comparison.motion->T * SmallMotion().inverse()), 0.05 * kDegree);
  EXPECT_TRUE(std::isnan(comparison.alignment->rms_m)) << "no marker was fitted to another";
  // The correction at the isocentre, which is the origin of IEC axes.
  const Eigen::Vector3d isocentre(0.62, 0.43, 0.1);
  EXPECT_LT((comparison.correction->isocentre_m - isocentre).norm(), 1e-9);
  const Vector6d truth = CouchVector(SmallMotion(), isocentre, RoomPose());
  EXPECT_NEAR(*comparison.correction->value.lateral_mm, truth[0] / kMillimetre, 0.3);
  EXPECT_NEAR(*comparison.correction->value.longitudinal_mm, truth[1] / kMillimetre, 0.3);
  EXPECT_NEAR(*comparison.correction->value.vertical_mm, truth[2] / kMillimetre, 0.3);
  EXPECT_NEAR(comparison.correction->value.yaw_deg, truth[5] / kDegree, 0.05);
  ASSERT_TRUE(comparison.planning);
  // Maps lie on the grid of the planned scene.
  ASSERT_TRUE(comparison.deviation && comparison.distance);
  EXPECT_EQ(comparison.deviation->grid, PlannedScene().height_map->grid);
  EXPECT_EQ(comparison.distance->grid, PlannedScene().height_map->grid);
}

TEST(PlannedReferenceTest, MonitoringGoesOnFromTheBodyWhereTheScanSawIt) {
  const Scene current = Current(SmallMotion());
  const Eigen::Vector3d body(0.6, 0.45, 0.1);
  std::vector<Message> warnings;
  const MonitorOptions options = MonitorOptionsOf(InRoom(), &PlannedScene(), current, warnings);
  ASSERT_TRUE(options.accepted) << testing::PrintToString(EnglishTexts(warnings));
  // The live motion is that of the scan's own frame, and is composed with this one.
  const Eigen::Vector3d in_scan =
      options.accepted->T_reference_current.inverse() * (options.accepted->T_motion * body);
  EXPECT_LT((in_scan - SmallMotion() * body).norm(), 0.5 * kMillimetre);
  EXPECT_LT(RotationAngle(options.accepted->T_reference_current), 1e-12);
}

// The plan states feet first for a patient who lies head first: the CT is turned about the
// isocentre.
TEST(PlannedReferenceTest, APlanWhoseHeadIsWhereTheFeetAreIsNamed) {
  Scene turned = PlannedScene();
  const Pose T(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ()));
  turned.cloud = TransformedCloud(T, turned.cloud);
  turned.height_map = ResampledHeightMap(*turned.height_map, T, turned.height_map->grid);
  turned.planning->posture = PatientPosture::kFeetFirstSupine;
  const Comparison comparison = Compare(turned, Current(SmallMotion()), InRoom());
  EXPECT_EQ(comparison.verdict, Verdict::kNoAnswer);
  ASSERT_FALSE(comparison.reasons.empty());
  EXPECT_EQ(comparison.reasons.front(), say::comparison::PlanOtherEnd("FFS"));
  EXPECT_FALSE(comparison.motion);
}

TEST(PlannedReferenceTest, WithoutARoomThereIsNoAnswer) {
  CompareOptions options = InRoom();
  options.T_iec_reference.reset();
  const Comparison comparison = Compare(PlannedScene(), Current(Pose::Identity()), options);
  EXPECT_EQ(comparison.verdict, Verdict::kNoAnswer);
  EXPECT_THAT(comparison.reasons, Says(say::comparison::kRoomNotCalibrated));
  EXPECT_FALSE(comparison.motion);
}

TEST(PlannedReferenceTest, FewMarkersInTheScanGiveNoAnswer) {
  Scene current = Current(Pose::Identity());
  while (current.markers.size() > 2) current.markers.erase(std::prev(current.markers.end()));
  const Comparison comparison = Compare(PlannedScene(), current, InRoom());
  EXPECT_EQ(comparison.verdict, Verdict::kNoAnswer);
  EXPECT_THAT(comparison.reasons, Says(say::comparison::kFewMarkersForRoom));
}

TEST(PlannedReferenceTest, MarkersThatAreNotGoodDoNotCount) {
  for (const int wrong : {0, 1, 2}) {
    Scene current = Current(Pose::Identity());
    while (current.markers.size() > 3) current.markers.erase(std::prev(current.markers.end()));
    SceneMarker& marker = current.markers.rbegin()->second;
    if (wrong == 0) marker.num_views = 1;
    if (wrong == 1) marker.sigma_m = 0.006;
    if (wrong == 2) {
      for (Eigen::Vector3d& corner : marker.corners)
        corner = marker.corners[0] + 1.1 * (corner - marker.corners[0]);
    }
    EXPECT_THAT(Compare(PlannedScene(), current, InRoom()).reasons,
                Says(say::comparison::kFewMarkersForRoom))
        << wrong;
  }
}

TEST(PlannedReferenceTest, ARoomWithoutAnUncertaintyIsTakenAsExactAndSaid) {
  CompareOptions exact = InRoom();
  exact.iec_u95_m.reset();
  const Scene current = Current(Pose::Identity());
  EXPECT_THAT(Compare(PlannedScene(), current, exact).warnings,
              Says(say::comparison::kRoomTakenAsExact));
  const Comparison stated = Compare(PlannedScene(), current, InRoom());
  EXPECT_THAT(stated.warnings, Not(Says(say::comparison::kRoomTakenAsExact)));
  // Its uncertainty is at the isocentre: 1 mm in each direction.
  ASSERT_TRUE(stated.motion);
  EXPECT_GT(stated.motion->uncertainty.room(3, 3), 0.9 * std::pow(0.001 / 1.96, 2));
  EXPECT_NEAR(stated.motion->uncertainty.room(0, 0), std::pow(0.1 * kDegree / 1.96, 2), 1e-9);
}

// With and without a statement of the lasers: a signed calibration widens the intervals, and is no
// statement.
TEST(PlannedReferenceTest, WhatACalibrationFoundOfItselfCountsButStatesNothingOfTheLasers) {
  const Scene current = Current(Pose::Identity());
  const auto share = [](const Comparison& comparison) {
    return comparison.motion ? comparison.motion->uncertainty.room(0, 0) : -1.0;
  };
  CompareOptions options = InRoom();
  options.calibration_u95_rad = 0.2 * kDegree;
  const Comparison stated = Compare(PlannedScene(), current, options);
  EXPECT_THAT(stated.warnings, Not(Says(say::comparison::kRoomTakenAsExact)));
  EXPECT_NEAR(share(stated),
              (std::pow(0.1 * kDegree, 2) + std::pow(0.2 * kDegree, 2)) / std::pow(1.96, 2), 1e-9);
  options.iec_u95_m.reset();
  options.iec_u95_rad.reset();
  options.calibration_u95_m = 0.002;
  const Comparison unstated = Compare(PlannedScene(), current, options);
  EXPECT_THAT(unstated.warnings, Says(say::comparison::kRoomTakenAsExact));
  EXPECT_NEAR(share(unstated), std::pow(0.2 * kDegree / 1.96, 2), 1e-9);
  ASSERT_TRUE(unstated.motion);
  EXPECT_GT(unstated.motion->uncertainty.room(3, 3), 0.9 * std::pow(0.002 / 1.96, 2));
}

TEST(PlannedReferenceTest, TheSkinCountsMostlyUpwards) {
  const Comparison comparison = Compare(PlannedScene(), Current(Pose::Identity()), InRoom());
  ASSERT_TRUE(comparison.motion);
  const Matrix6d& skin = comparison.motion->uncertainty.skin;
  const double sigma_m = 0.001 / 1.96;
  EXPECT_GT(std::sqrt(skin(5, 5)), 0.9 * sigma_m);
  EXPECT_LT(std::sqrt(skin(5, 5)), 1.8 * sigma_m);
  EXPECT_LT(std::sqrt(skin(3, 3)), 0.5 * sigma_m);
  EXPECT_EQ(comparison.motion->uncertainty.Parts().size(), 10U);
}

// Half-widths of what is stated, in metres: once in the scene, once in the options.
Comparison Stated(const StatedSurface& in_scene, const std::optional<StatedSurface>& in_options,
                  const Scene& current) {
  Scene planned = PlannedScene();
  planned.planning->surface = in_scene;
  CompareOptions options = InRoom();
  options.surface = in_options;
  return Compare(planned, current, options);
}

TEST(PlannedReferenceTest, WhatIsStatedOfTheSurfaceWidensTheIntervalsByCause) {
  const Scene current = Current(SmallMotion());
  const Comparison bare = Compare(PlannedScene(), current, InRoom());
  const StatedSurface both{.clothing_u95_m = 0.005, .ct_breathing_u95_m = 0.008};
  const Comparison stated = Stated(both, std::nullopt, current);
  ASSERT_TRUE(bare.motion && stated.motion && bare.correction && stated.correction);
  const MotionUncertainty& parts = stated.motion->uncertainty;
  EXPECT_EQ(parts.Parts().size(), 12U);
  // As the skin counts, which is everywhere farther out; one half alone comes on top.
  const double skin_m = std::sqrt(parts.skin(5, 5)) * 1.96 / 0.001;
  EXPECT_NEAR(std::sqrt(parts.clothing(5, 5)) * 1.96, 0.005 * skin_m, 0.0005);
  EXPECT_NEAR(std::sqrt(parts.ct_breathing(5, 5)) * 1.96, 0.008, 0.0005) << "straight up";
  // The tilt of one half, 0.2 to 0.4 m long, about the axis across the couch: y of the markers.
  EXPECT_GT(std::sqrt(parts.clothing(1, 1)) * 1.96, 0.75 * 0.005 / 0.4);
  EXPECT_LT(std::sqrt(parts.clothing(1, 1)) * 1.96, 0.75 * 0.005 / 0.1);
  EXPECT_GT(std::sqrt(parts.ct_breathing(1, 1)) * 1.96, 0.75 * 0.008 / 0.4);
  EXPECT_GT(parts.clothing(0, 0), 25 * parts.skin(0, 0)) << "a cover on one side rolls the body";
  EXPECT_TRUE(stated.motion->covariance.isApprox(parts.Total()));
  EXPECT_TRUE((parts.Total() - parts.clothing - parts.ct_breathing)
                  .isApprox(bare.motion->uncertainty.Total(), 1e-12));
  EXPECT_GT(*stated.correction->u95.vertical_mm, 8.0);
  EXPECT_LT(*bare.correction->u95.vertical_mm, 3.0);
  EXPECT_EQ(stated.motion->T.matrix(), bare.motion->T.matrix()) << "no number is changed";
  EXPECT_EQ(stated.planning->surface.clothing_u95_m, 0.005);
}

TEST(PlannedReferenceTest, NothingStatedCountsForNothing) {
  const Scene current = Current(SmallMotion());
  const Comparison bare = Compare(PlannedScene(), current, InRoom());
  const Comparison zero = Stated({}, StatedSurface{}, current);
  ASSERT_TRUE(bare.motion && zero.motion);
  EXPECT_EQ(zero.motion->covariance, bare.motion->covariance) << "bit for bit";
  EXPECT_EQ(zero.motion->uncertainty.Parts().size(), 10U);
  // A plan that states nothing counts, not what the scene of the files states.
  const Comparison cleared = Stated({.clothing_u95_m = 0.01}, StatedSurface{}, current);
  EXPECT_EQ(cleared.motion.value().covariance, bare.motion->covariance);
  for (const double wrong : {-0.001, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW((void)Stated({}, StatedSurface{.clothing_u95_m = wrong}, current),
                 std::invalid_argument);
    EXPECT_THROW((void)Stated({}, StatedSurface{.ct_breathing_u95_m = wrong}, current),
                 std::invalid_argument);
  }
}

// How many of the six numbers of a body that lies where it was planned are outside their intervals,
// where its surface is higher by up to 6 mm, from the feet to the head over `ramp_m`.
int NumbersOutside(double ramp_m, const StatedSurface& stated) {
  SyntheticOptions raised = PlacedBody();
  raised.deform = [=](const Eigen::Vector3d& p) {
    return Eigen::Vector3d(0, 0, 0.006 * std::clamp(0.5 + p.x() / ramp_m, 0.0, 1.0));
  };
  const Comparison comparison = Stated(stated, std::nullopt, Current(Pose::Identity(), raised));
  const CouchNumbers &off = comparison.correction.value().value, &u95 = comparison.correction->u95;
  return (std::abs(*off.vertical_mm) > *u95.vertical_mm) +
         (std::abs(*off.longitudinal_mm) > *u95.longitudinal_mm) +
         (std::abs(*off.lateral_mm) > *u95.lateral_mm) + (std::abs(off.pitch_deg) > u95.pitch_deg) +
         (std::abs(off.roll_deg) > u95.roll_deg) + (std::abs(off.yaw_deg) > u95.yaw_deg);
}

TEST(PlannedReferenceTest, TheTruthLiesInTheIntervalsWhereItIsStated) {
  // A cover over one half, 3.6 mm and 1.03 deg off; a chest that is fuller than at the CT.
  constexpr double kCover_m = 0.1, kBreath_m = 0.5;
  EXPECT_GE(NumbersOutside(kCover_m, {}), 2) << "height and pitch";
  EXPECT_EQ(NumbersOutside(kCover_m, {.clothing_u95_m = 0.006}), 0);
  EXPECT_GE(NumbersOutside(kBreath_m, {}), 2) << "height and pitch";
  EXPECT_EQ(NumbersOutside(kBreath_m, {.ct_breathing_u95_m = 0.006}), 0);
}

TEST(PlannedReferenceTest, TaughtMarkersPlaceTheScanInsteadOfTheReferenceMarker) {
  // The scan's own frame is turned by 0.5 deg against the taught one: as if its reference marker
  // had been seen askew.
  CompareOptions options = InRoom();
  options.room_markers = MakeSyntheticScene(PlacedBody()).markers;
  Scene current = Current(SmallMotion());
  const Pose askew(Eigen::AngleAxisd(0.5 * kDegree, Eigen::Vector3d::UnitX()));
  for (auto& [id, marker] : current.markers)
    for (Eigen::Vector3d& corner : marker.corners) corner = askew * corner;
  current.cloud = TransformedCloud(Eigen::Affine3d(askew.matrix()), current.cloud);
  current.height_map.reset();
  const Comparison comparison = Compare(PlannedScene(), current, options);
  ASSERT_TRUE(comparison.motion);
  const Eigen::Vector3d body(0.6, 0.45, 0.1);
  const auto error_m = [&](const Comparison& one) {
    return (one.motion->T * (askew * body) - askew * (SmallMotion() * body)).norm();
  };
  EXPECT_LT(error_m(comparison), 0.3 * kMillimetre);
  EXPECT_THAT(comparison.warnings, Not(Says(say::comparison::kOneMarkerForPlan)));
  // A signed calibration has its markers in the axes of the room.
  CompareOptions is_signed = options;
  is_signed.T_iec_reference = Pose::Identity();
  for (auto& [id, marker] : is_signed.room_markers)
    for (Eigen::Vector3d& corner : marker.corners) corner = RoomPose() * corner;
  const Comparison by_signed = Compare(PlannedScene(), current, is_signed);
  ASSERT_TRUE(by_signed.motion && by_signed.correction && comparison.correction);
  EXPECT_LT(error_m(by_signed), 0.3 * kMillimetre);
  EXPECT_LT((by_signed.correction->isocentre_m - comparison.correction->isocentre_m).norm(), 1e-6);
  EXPECT_NEAR(by_signed.correction->value.yaw_deg, comparison.correction->value.yaw_deg, 1e-3);
  options.room_markers.clear();
  const Comparison alone = Compare(PlannedScene(), current, options);
  ASSERT_TRUE(alone.motion);
  EXPECT_GT(error_m(alone), 2 * kMillimetre);
  EXPECT_THAT(alone.warnings, Says(say::comparison::kOneMarkerForPlan));
}

TEST(PlannedReferenceTest, AnotherIsocentreIsSaidAndThePlansUsed) {
  CompareOptions options = InRoom();
  options.isocentre_m = Eigen::Vector3d(0.62, 0.43, 0.105);
  const Comparison comparison = Compare(PlannedScene(), Current(Pose::Identity()), options);
  EXPECT_THAT(comparison.warnings, Says(say::comparison::kIsocentreOfPlan));
  ASSERT_TRUE(comparison.correction);
  EXPECT_NEAR(comparison.correction->isocentre_m.z(), 0.1, 1e-9);
}

// Another room: its reference marker hangs elsewhere.
Pose OtherRoomPose() {
  Pose T = Pose(Eigen::AngleAxisd(-0.4, Eigen::Vector3d::UnitZ())) * RoomPose();
  T.translation() += Eigen::Vector3d(0.13, -0.08, 0.05);
  return T;
}

/// The current room as by the options' own fields, the reference's beside them.
CompareOptions InTwoRooms() {
  CompareOptions options;
  options.T_iec_reference = OtherRoomPose();
  options.iec_u95_m = 0.0006;
  options.iec_u95_rad = 0.03 * kDegree;
  options.reference_room =
      CalibratedRoom{.T_iec_reference = RoomPose(), .u95_m = 0.0008, .u95_rad = 0.05 * kDegree};
  return options;
}

/// The body moved by `T_motion` in the frame of the first room's marker, scanned in the other room.
Scene InOtherRoom(const Pose& T_motion) {
  SyntheticOptions options = PlacedBody();
  options.seed += 7;
  options.T_reference_body =
      OtherRoomPose().inverse() * RoomPose() * T_motion * options.T_reference_body;
  return MakeSyntheticScene(options);
}

const Scene& ReferenceScan() {
  static const Scene scene = MakeSyntheticScene(PlacedBody());
  return scene;
}

TEST(TwoRoomsTest, TheMotionIsThatInTheRoomOfTheReference) {
  const Comparison comparison = Compare(ReferenceScan(), InOtherRoom(SmallMotion()), InTwoRooms());
  ASSERT_TRUE(comparison.motion && comparison.correction);
  const Eigen::Vector3d centroid = comparison.motion->centroid_m;
  EXPECT_LT((comparison.motion->T * centroid - SmallMotion() * centroid).norm(), 0.0005);
  EXPECT_LT(
      Eigen::AngleAxisd(comparison.motion->T.linear() * SmallMotion().linear().transpose()).angle(),
      0.05 * kDegree);
  const Vector6d truth = CouchVector(SmallMotion(), comparison.correction->isocentre_m, RoomPose());
  EXPECT_NEAR(*comparison.correction->value.lateral_mm, truth[0] / kMillimetre, 0.5);
  EXPECT_NEAR(*comparison.correction->value.longitudinal_mm, truth[1] / kMillimetre, 0.5);
  EXPECT_NEAR(*comparison.correction->value.vertical_mm, truth[2] / kMillimetre, 0.5);
  EXPECT_EQ(comparison.deviation->grid, ReferenceScan().height_map->grid);
}

TEST(TwoRoomsTest, BothCalibrationsAreInTheIntervals) {
  const Scene current = InOtherRoom(Pose::Identity());
  const auto room = [&](const CompareOptions& options) {
    return Compare(ReferenceScan(), current, options).motion.value().uncertainty.room;
  };
  CompareOptions without_first = InTwoRooms(), without_second = InTwoRooms();
  without_first.reference_room->u95_m = without_first.reference_room->u95_rad = 0.0;
  without_second.iec_u95_m = without_second.iec_u95_rad = 0.0;
  const Matrix6d both = room(InTwoRooms());
  EXPECT_TRUE(both.isApprox(room(without_first) + room(without_second), 1e-9));
  // The translation at the isocentre by itself: (0.8² + 0.6²) mm² / 1.96², and more away from it.
  EXPECT_GE(both(3, 3), 1e-6 / (1.96 * 1.96) * 0.999);
  EXPECT_GT(room(without_first)(3, 3), 0.35e-6 / (1.96 * 1.96));
}

TEST(TwoRoomsTest, AMarkerThatMovedInTheReferencesRoomIsNotUsed) {
  const Scene current = InOtherRoom(Pose::Identity());
  CompareOptions options = InTwoRooms();
  options.reference_room->markers = ReferenceScan().markers;
  for (Eigen::Vector3d& corner : options.reference_room->markers.rbegin()->second.corners)
    corner.x() += 0.05;
  EXPECT_TRUE(Compare(ReferenceScan(), current, options).motion) << "it is left out";
  // The method as published uses it.
  options.preset = Preset::kPaper;
  const Comparison published = Compare(ReferenceScan(), current, options);
  EXPECT_EQ(published.verdict, Verdict::kNoAnswer);
  EXPECT_FALSE(published.motion);
  EXPECT_THAT(published.reasons.at(0).English(), testing::StartsWith("the reference scan"));
}

TEST(TwoRoomsTest, ARoomThatIsNotCalibratedIsNamed) {
  const Scene current = InOtherRoom(Pose::Identity());
  CompareOptions options = InTwoRooms();
  options.reference_room->T_iec_reference.reset();
  Comparison comparison = Compare(ReferenceScan(), current, options);
  EXPECT_EQ(comparison.verdict, Verdict::kNoAnswer);
  EXPECT_THAT(comparison.reasons.at(0).English(), testing::StartsWith("the reference scan"));
  options = InTwoRooms();
  options.T_iec_reference.reset();
  comparison = Compare(ReferenceScan(), current, options);
  EXPECT_EQ(comparison.verdict, Verdict::kNoAnswer);
  EXPECT_THAT(comparison.reasons.at(0).English(), testing::StartsWith("the current scan"));
}

TEST(TwoRoomsTest, TheMarkersOfTheRoomsMayDiffer) {
  Scene current = InOtherRoom(Pose::Identity());
  MarkerMap renamed;
  for (auto& [id, marker] : current.markers) renamed[id + 500] = marker;
  current.markers = renamed;
  current.room_markers.dictionary = "DICT_ARUCO_MIP_36h12";
  if (current.room_markers.reference) *current.room_markers.reference += 500;
  const Comparison comparison = Compare(ReferenceScan(), current, InTwoRooms());
  ASSERT_TRUE(comparison.motion);
  EXPECT_LT(
      (comparison.motion->T * comparison.motion->centroid_m - comparison.motion->centroid_m).norm(),
      0.0005);
}

}  // namespace
}  // namespace plumb
