// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/marker_check.hpp"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace plumb {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kLength_m = 0.104;

// Twelve markers in a row of three, 0.4 m apart.
Scene Room() {
  Scene scene;
  scene.room_markers.dictionary = "DICT_6X6_250";
  scene.room_markers.length_m = kLength_m;
  for (int id = 0; id < 12; ++id) {
    SceneMarker marker;
    const Eigen::Vector3d place(0.4 * (id % 4), 0.4 * (id / 4), 0.0);
    marker.corners = CornersInMarkerFrame(kLength_m);
    for (Eigen::Vector3d& corner : marker.corners) corner += place;
    marker.num_views = 10;
    scene.markers[id] = marker;
  }
  scene.calibration["depth_scale"] = 1.004;
  return scene;
}

void Move(Scene& scene, int id, const Eigen::Vector3d& by) {
  for (Eigen::Vector3d& corner : scene.markers[id].corners) corner += by;
}

const MarkerCheckItem& Item(const MarkerCheck& check, const std::string& name) {
  static const MarkerCheckItem kNone;
  for (const MarkerCheckItem& item : check.items) {
    if (item.name == name) return item;
  }
  ADD_FAILURE() << "no item " << name;
  return kNone;
}

MarkerCheck Against(const Scene& scene) { return CheckMarkers(scene, BaselineOf(Room())); }

TEST(MarkerCheckTest, TheSameMarkersFromElsewherePass) {
  Scene scene = Room();
  const Pose T(Eigen::Translation3d(0.3, -1, 2) *
               Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, 2, 3).normalized()));
  for (auto& [id, marker] : scene.markers) {
    for (Eigen::Vector3d& corner : marker.corners) corner = T * corner;
  }
  const MarkerCheck check = Against(scene);
  EXPECT_EQ(check.status, MarkerCheckStatus::kPassed);
  EXPECT_THAT(EnglishTexts(check.reasons), IsEmpty());
  EXPECT_NEAR(Item(check, "misfit").value, 0.0, 1e-6);
  EXPECT_EQ(Item(check, "markers_seen").value, 12);
  EXPECT_NEAR(Item(check, "depth_scale").value, 0.4, 1e-9);
}

TEST(MarkerCheckTest, AMovedMarkerIsNamedWithHowFar) {
  Scene scene = Room();
  Move(scene, 7, {0.012, 0, 0});
  const MarkerCheck check = Against(scene);
  EXPECT_EQ(check.status, MarkerCheckStatus::kFailed);
  EXPECT_THAT(EnglishTexts(check.reasons), Contains("marker 7 moved 12 mm"));
  EXPECT_NEAR(Item(check, "moved").value, 12.0, 0.5);
  EXPECT_EQ(Item(check, "moved").note.English(), "marker 7");
  EXPECT_TRUE(Item(check, "misfit").passed) << "the moved one is not counted among the others";
}

TEST(MarkerCheckTest, TheLimitOfAMoveIsWhereItIsSaid) {
  for (const Eigen::Vector3d& way : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 0, -1)}) {
    Scene scene = Room();
    Move(scene, 7, 0.0049 * way);
    const MarkerCheck near = Against(scene);
    EXPECT_EQ(near.status, MarkerCheckStatus::kPassed);
    EXPECT_NEAR(Item(near, "moved").value, 4.9, 1e-6) << "the others do not follow it";
    scene = Room();
    Move(scene, 7, 0.0051 * way);
    const MarkerCheck far = Against(scene);
    EXPECT_EQ(far.status, MarkerCheckStatus::kFailed);
    EXPECT_THAT(EnglishTexts(far.reasons), Contains(HasSubstr("marker 7 moved 5 mm")));
  }
}

// About its own centre, by an axis of the marker.
void Turn(Scene& scene, int id, double angle_deg,
          const Eigen::Vector3d& axis = Eigen::Vector3d::UnitZ()) {
  const Eigen::Vector3d centre = CentreOf(scene.markers[id].corners);
  const Eigen::AngleAxisd turn(angle_deg * kDegree, axis);
  for (Eigen::Vector3d& corner : scene.markers[id].corners)
    corner = centre + turn * (corner - centre);
}

TEST(MarkerCheckTest, AMarkerThatWasTurnedInItsPlaceIsNamedWithItsAngle) {
  for (const int angle_deg : {5, 90, 180}) {
    Scene scene = Room();
    Turn(scene, 7, angle_deg);
    const MarkerCheck check = Against(scene);
    EXPECT_EQ(check.status, MarkerCheckStatus::kFailed) << angle_deg;
    EXPECT_FALSE(Item(check, "moved").passed);
    EXPECT_THAT(EnglishTexts(check.reasons),
                ElementsAre("marker 7 was turned by " + std::to_string(angle_deg) + " deg"));
    EXPECT_EQ(Item(check, "moved").note, check.reasons.at(0)) << "no centre that moved";
    EXPECT_TRUE(Item(check, "misfit").passed);
  }
  Scene lifted = Room();  // at one of its sides
  Turn(lifted, 7, 8, Eigen::Vector3d::UnitX());
  EXPECT_THAT(EnglishTexts(Against(lifted).reasons), ElementsAre("marker 7 was turned by 8 deg"));
  Scene moved = Room();
  Turn(moved, 7, 90);
  Move(moved, 7, {0.02, 0, 0});
  EXPECT_THAT(EnglishTexts(Against(moved).reasons), ElementsAre(HasSubstr("marker 7 moved 1")));
}

// Each corner lies 73.5 mm from the centre: it moves by 5 mm at 3.9 deg.
TEST(MarkerCheckTest, TheLimitOfATurnIsThatOfAMoveAtTheCorners) {
  Scene scene = Room();
  Turn(scene, 7, 3.85);
  const MarkerCheck near = Against(scene);
  EXPECT_EQ(near.status, MarkerCheckStatus::kPassed);
  EXPECT_NEAR(Item(near, "moved").value, 4.94, 0.01);
  EXPECT_EQ(Item(near, "moved").note.English(), "marker 7");
  scene = Room();
  Turn(scene, 7, 3.95);
  EXPECT_EQ(Against(scene).status, MarkerCheckStatus::kFailed);
  MarkerCheckLimits tight;
  tight.max_moved_m = 0.002;
  scene = Room();
  Turn(scene, 7, 1.5);
  EXPECT_EQ(CheckMarkers(scene, BaselineOf(Room()), tight).status, MarkerCheckStatus::kPassed);
  Turn(scene, 7, 0.2);
  EXPECT_EQ(CheckMarkers(scene, BaselineOf(Room()), tight).status, MarkerCheckStatus::kFailed);
}

TEST(MarkerCheckTest, AnotherBaselineNamesWhatWasTurned) {
  const auto changes = [](double angle_deg) {
    Scene scene = Room();
    Turn(scene, 7, angle_deg);
    return EnglishTexts(ChangesOfBaseline(BaselineOf(Room()), BaselineOf(scene)));
  };
  EXPECT_THAT(changes(180), ElementsAre("marker 7 was turned by 180 deg"));
  EXPECT_THAT(changes(3), ElementsAre("marker 7 was turned by 3 deg"));
  EXPECT_THAT(changes(1), ElementsAre(Not(HasSubstr("turned"))));
}

TEST(MarkerCheckTest, AMoveWithinTheLimitPasses) {
  Scene scene = Room();
  Move(scene, 7, {0.003, 0, 0});
  EXPECT_EQ(Against(scene).status, MarkerCheckStatus::kPassed);
}

// Of twelve, ten are 80 % at least.
TEST(MarkerCheckTest, AShareOfTheMarkersMustBeSeenAndTheOthersAreNamed) {
  Scene scene = Room();
  scene.markers.erase(3);
  scene.markers[9].num_views = 2;
  const MarkerCheck enough = Against(scene);
  EXPECT_EQ(enough.status, MarkerCheckStatus::kPassed);
  EXPECT_THAT(EnglishTexts(enough.reasons), IsEmpty());
  EXPECT_EQ(Item(enough, "markers_seen").value, 10);
  EXPECT_EQ(Item(enough, "markers_seen").limit, 10);
  EXPECT_EQ(Item(enough, "markers_seen").note.English(), "missing: 3, 9");
  EXPECT_THAT(EnglishTexts(enough.cautions),
              ElementsAre(HasSubstr("markers 3, 9 were not seen well and were not checked")));
  scene.markers.erase(10);
  const MarkerCheck few = Against(scene);
  EXPECT_EQ(few.status, MarkerCheckStatus::kFailed);
  EXPECT_FALSE(Item(few, "markers_seen").passed);
  EXPECT_THAT(EnglishTexts(few.reasons),
              ElementsAre(HasSubstr("markers 3, 9, 10 were not seen well: check that they are")));
  EXPECT_THAT(EnglishTexts(few.cautions), IsEmpty()) << "it is said once";
}

TEST(MarkerCheckTest, TheShareIsThatOfTheLimits) {
  Scene scene = Room();
  scene.markers.erase(3);
  const auto with = [&](double share) {
    MarkerCheckLimits limits;
    limits.min_seen_share = share;
    return CheckMarkers(scene, BaselineOf(Room()), limits).status;
  };
  EXPECT_EQ(with(11.0 / 12), MarkerCheckStatus::kPassed);
  EXPECT_EQ(with(0.92), MarkerCheckStatus::kFailed) << "of twelve that is all";
  EXPECT_EQ(with(1), MarkerCheckStatus::kFailed);
}

TEST(MarkerCheckTest, OneMarkerIsNamedInTheSingular) {
  Scene scene = Room();
  scene.markers.erase(4);
  EXPECT_THAT(EnglishTexts(Against(scene).cautions),
              ElementsAre(HasSubstr("marker 4 was not seen well and was not checked")));
  MarkerBaseline few = BaselineOf(Room());  // of four, all are needed
  few.markers.erase(few.markers.find(4), few.markers.end());
  scene.markers.erase(3);
  const Message sentence = CheckMarkers(scene, few).reasons.at(0);
  EXPECT_EQ(
      sentence.English(),
      "marker 3 was not seen well: check that it is there, clean and uncovered, and sweep over "
      "all");
  const auto in = [&](const char* language) { return Text(sentence, *FindCatalogue(language)); };
  EXPECT_THAT(in("de"), HasSubstr("Marker 3 wurde nicht gut gesehen: prüfen Sie, ob er da"));
  EXPECT_THAT(in("es"), HasSubstr("el marcador 3 no se vio bien"));
  EXPECT_THAT(in("fr"), HasSubstr("le marqueur 3 n'a pas été bien vu"));
}

TEST(MarkerCheckTest, WithoutTheReferenceMarkerItFailsWhateverElseWasSeen) {
  for (const bool has_baseline : {true, false}) {
    Scene scene = Room();
    scene.room_markers.reference = 6;
    const auto baseline = has_baseline ? std::optional(BaselineOf(scene)) : std::nullopt;
    EXPECT_TRUE(Item(CheckMarkers(scene, baseline), "markers_seen").passed);
    scene.markers[6].num_views = MarkerCheckLimits{}.min_views;
    EXPECT_TRUE(Item(CheckMarkers(scene, baseline), "markers_seen").passed);
    --scene.markers[6].num_views;
    const MarkerCheck check = CheckMarkers(scene, baseline);
    EXPECT_EQ(check.status, MarkerCheckStatus::kFailed);
    EXPECT_FALSE(Item(check, "markers_seen").passed);
    EXPECT_THAT(EnglishTexts(check.reasons),
                ElementsAre(HasSubstr("the reference marker, 6, was not seen well")));
  }
}

// A change is of as many markers as it names.
TEST(MarkerCheckTest, WhatAnotherBaselineChangesIsNamedInTheSingularToo) {
  MarkerBaseline wanted = BaselineOf(Room());
  wanted.markers.erase(5);
  EXPECT_THAT(EnglishTexts(ChangesOfBaseline(BaselineOf(Room()), wanted)),
              ElementsAre("no longer part of the baseline: marker 5"));
  wanted.markers.erase(6);
  EXPECT_THAT(EnglishTexts(ChangesOfBaseline(wanted, BaselineOf(Room()))),
              ElementsAre("new in the baseline: markers 5, 6"));
}

TEST(MarkerCheckTest, AWholeThatGrewIsACalibrationThatChanged) {
  Scene scene = Room();
  for (auto& [id, marker] : scene.markers) {
    for (Eigen::Vector3d& corner : marker.corners) corner *= 1.008;
  }
  const MarkerCheck check = Against(scene);
  EXPECT_NEAR(Item(check, "scale").value, 0.8, 1e-3);
  EXPECT_FALSE(Item(check, "scale").passed);
  EXPECT_EQ(check.status, MarkerCheckStatus::kFailed);
}

TEST(MarkerCheckTest, APrintOfTheWrongSizeFails) {
  Scene scene = Room();
  const Eigen::Vector3d centre = (scene.markers[5].corners[0] + scene.markers[5].corners[2]) / 2;
  for (Eigen::Vector3d& corner : scene.markers[5].corners)
    corner = centre + 0.96 * (corner - centre);
  const MarkerCheck check = Against(scene);
  EXPECT_NEAR(Item(check, "side").value, -4.0, 1e-6);
  EXPECT_EQ(Item(check, "side").note.English(), "marker 5");
  EXPECT_EQ(check.status, MarkerCheckStatus::kFailed);
}

TEST(MarkerCheckTest, SidesThatWereTakenForGrantedAreNotJudged) {
  for (const MarkerCheckItem& item : Against(Room()).items) EXPECT_NE(item.name, "side");
}

TEST(MarkerCheckTest, DepthThatIsOffFails) {
  Scene scene = Room();
  scene.calibration["depth_scale"] = 0.96;
  const MarkerCheck check = Against(scene);
  EXPECT_FALSE(Item(check, "depth_scale").passed);
  EXPECT_THAT(EnglishTexts(check.reasons), Contains(HasSubstr("-4.0 %")));
}

TEST(MarkerCheckTest, RefusesASweepThatDidNotMeasureTheDepth) {
  Scene scene = Room();
  for (const double scale : {1.029, 0.971}) {
    scene.calibration["depth_scale"] = scale;
    EXPECT_TRUE(Item(Against(scene), "depth_scale").passed) << scale;
  }
  scene.calibration["depth_scale"] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(Item(Against(scene), "depth_scale").passed);
  scene.calibration.erase("depth_scale");
  const MarkerCheck check = Against(scene);
  EXPECT_EQ(check.status, MarkerCheckStatus::kFailed);
  EXPECT_FALSE(Item(check, "depth_scale").passed);
  EXPECT_THAT(EnglishTexts(check.reasons),
              Contains(HasSubstr("cannot confirm the sensor's depth")));
}

TEST(MarkerCheckTest, WithoutABaselineItSaysSoAndDoesNotPass) {
  const MarkerCheck check = CheckMarkers(Room(), std::nullopt);
  EXPECT_EQ(check.status, MarkerCheckStatus::kNoBaseline);
  EXPECT_THAT(EnglishTexts(check.reasons), Contains(HasSubstr("no baseline yet")));
}

TEST(MarkerCheckTest, OtherMarkersThanTheBaselinesFail) {
  Scene scene = Room();
  scene.room_markers.dictionary = "DICT_4X4_50";
  EXPECT_THAT(EnglishTexts(Against(scene).reasons), Contains(HasSubstr("take a new baseline")));
}

TEST(MarkerCheckTest, NothingSeenIsAFailureAndNoCrash) {
  Scene empty = Room();
  empty.markers.clear();
  EXPECT_EQ(Against(empty).status, MarkerCheckStatus::kFailed);
  EXPECT_EQ(CheckMarkers(empty, std::nullopt).status, MarkerCheckStatus::kFailed);
  Scene broken = Room();
  broken.markers[0].corners[0].x() = std::nan("");
  EXPECT_EQ(Against(broken).status, MarkerCheckStatus::kPassed) << "of a marker that was not seen";
  EXPECT_EQ(Item(Against(broken), "markers_seen").note.English(), "missing: 0");
}

}  // namespace
}  // namespace plumb
