// SPDX-License-Identifier: Apache-2.0
// The profile of the sensor's unit and the calibration of the room, as the page changes them.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/units.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/scanning/unit_profile.hpp"
#include "daemon/sensor_profiles/profile_shelf.hpp"
#include "tests/support/board_checks.hpp"
#include "tests/support/synthetic_scene.hpp"
#include "tests/unit/appliance/appliance_fixture.hpp"
#include "words/scan.hpp"

namespace plumb {
namespace {

using testing::ApplianceTest;
using testing::FakeBus;

class ApplianceProfileTest : public ApplianceTest {
 protected:
  /// What the page's last request was answered.
  Change Asked(const std::function<void(Done)>& ask) {
    const auto answer = std::make_shared<std::promise<Change>>();
    On([&] { ask([answer](const Change& change) { answer->set_value(change); }); });
    return answer->get_future().get();
  }
  Change Reset(const std::string& serial) {
    return Asked(
        [&](Done done) { services_->services().profiles.ResetSensorProfile(erik_, serial, done); });
  }
  Change RollBack(int version) {
    return Asked([&](Done done) {
      services_->services().profiles.RollBackSensorProfile(erik_, "A", version, done);
    });
  }
  /// The profile that a scan of now begins from: read as each scan reads it, from the same shelf.
  [[nodiscard]] std::string NextScanBeginsFrom() const {
    UnitProfile unit(shared_->profiles.shelf(), "A", FakeBus::Info().intrinsics);
    ReconstructorOptions options;
    unit.Begin(options);
    if (!options.profile) return "none";
    return fmt::format("{}, {} sweeps", options.profile->name, options.profile->num_sweeps);
  }

  const Actor erik_{.user = "erik", .address = {}};
};

TEST_F(ApplianceProfileTest, WhatThePageAsksIsWhatTheNextScanBeginsFrom) {
  SensorProfile known = ProfileOfAnyUnit(FakeBus::Info().intrinsics);
  ProfileShelf shelf(folder_ / "state" / "sensor-profiles");
  for (known.num_sweeps = 4; known.num_sweeps <= 5; ++known.num_sweeps) (void)shelf.Add("A", known);
  Play([&] {
    EXPECT_EQ(services_->services().profiles.GetSensorProfiles().why_none, say::scan::NoSensor());
    EXPECT_EQ(Reset("A").result, ChangeResult::kConflict);
    MakeReady();
    const SensorProfiles shown = services_->services().profiles.GetSensorProfiles();
    EXPECT_EQ(shown.serial, "A");
    EXPECT_TRUE(shown.why_none.empty());
    ASSERT_EQ(shown.versions.size(), 2U);
    EXPECT_EQ(shown.versions[0].version, 2);
    EXPECT_EQ(shown.versions[0].num_sweeps, 5);
    EXPECT_EQ(shown.versions[0].cause, ProfileCause::kLearned);
    EXPECT_EQ(NextScanBeginsFrom(), "A version 2, 5 sweeps");

    EXPECT_EQ(Reset("B").result, ChangeResult::kConflict) << "another unit";
    EXPECT_EQ(RollBack(7).result, ChangeResult::kNotFound);
    EXPECT_EQ(NextScanBeginsFrom(), "A version 2, 5 sweeps") << "refused: nothing has changed";
    EXPECT_EQ(Reset("A").result, ChangeResult::kDone);
    EXPECT_EQ(NextScanBeginsFrom(), "none");
    EXPECT_EQ(RollBack(1).result, ChangeResult::kDone);
    EXPECT_EQ(NextScanBeginsFrom(), "A version 4, 4 sweeps");
    EXPECT_FALSE(services_->services().profiles.SensorProfileFile(3)) << "the reset";
    EXPECT_THAT(services_->services().profiles.SensorProfileFile(4).value_or(""),
                ::testing::HasSubstr("calibration"));
  });
}

TEST_F(ApplianceProfileTest, NothingChangesUnderAScan) {
  Play([&] {
    MakeReady();
    On([&] { EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), ""); });
    const Change answer = Reset("A");
    EXPECT_EQ(answer.result, ChangeResult::kConflict);
    EXPECT_THAT(answer.message.English(), ::testing::HasSubstr("wait for its result"));
    EXPECT_TRUE(services_->services().profiles.GetSensorProfiles().versions.empty());
    On([&] { EXPECT_EQ(appliance_->Cancel(kTester).English(), ""); });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    EXPECT_EQ(Reset("A").result, ChangeResult::kDone);
    EXPECT_EQ(services_->services().profiles.GetSensorProfiles().versions.size(), 1U);
  });
}

TEST_F(ApplianceProfileTest, SwitchedOffItSaysSo) {
  parts_.config.appliance.sensor_profiles = false;
  Play([&] {
    MakeReady();
    EXPECT_THAT(services_->services().profiles.GetSensorProfiles().why_none.English(),
                ::testing::HasSubstr("switched off"));
    EXPECT_EQ(Reset("A").result, ChangeResult::kConflict);
  });
}

class ApplianceRoomTest : public ApplianceProfileTest {
 protected:
  void ScanBoard() {
    On([&] { (void)shared_->store->checks.Add(erik_, "A", testing::CheckOver()); });
  }
  ChangeResult Sign() {
    const std::string digest = services_->services().room.GetRoomCalibration().digest;
    return Asked([&](Done done) {
             services_->services().room.SignRoomCalibration(erik_, digest, done);
           })
        .result;
  }
  /// Where the gantry is on a map, as reported to the page; empty when it is not known.
  std::optional<Eigen::Vector2d> Gantry() {
    std::optional<Eigen::Vector2d> gantry;
    On([&] {
      const Status status = appliance_->WebStatus();
      if (status.room.is_known) gantry = Eigen::Vector2d(status.room.gantry_xy.data());
      warnings_ = fmt::format("{}", fmt::join(EnglishTexts(status.warnings), "; "));
    });
    return gantry;
  }
  /// A reference whose scan saw these markers.
  Reference ReferenceOf(const MarkerMap& markers) {
    std::optional<Reference> reference;
    On([&] {
      Store& store = *shared_->store.get();
      test::SyntheticOptions options;
      options.with_cloud = false;
      Scene scene = test::MakeSyntheticScene(options);
      scene.markers = markers;
      const std::string id = store.scans.Begin({.patient_id = store.patients.Add(erik_, "P-1", ""),
                                                .reference_id = {},
                                                .purpose = ScanPurpose::kReference,
                                                .sensor_serial = "A"});
      WriteScene(scene, store.folders.Staging(id) / "scene");
      store.scans.Finish(id, {.outcome = ScanOutcome::kDone});
      reference = store.references.Find(store.references.Add(erik_, id, "", {}));
    });
    return reference.value();
  }
  std::string warnings_;
};

TEST_F(ApplianceRoomTest, ASignedCalibrationHoldsInPlaceOfTheConfigurationUntilAMarkerMoves) {
  const Eigen::Vector2d configured(0, 1);
  const Eigen::Vector2d calibrated =
      testing::SceneFromRoom().inverse().linear().block<1, 2>(1, 0).transpose();
  parts_.config.compare.T_iec_reference = Pose::Identity();
  Play([&] {
    MakeReady();
    EXPECT_EQ(Gantry(), configured);
    EXPECT_TRUE(services_->services().room.GetRoomCalibration().is_configured);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NE(Sign(), ChangeResult::kDone) << i << " scans";
      ScanBoard();
    }
    EXPECT_EQ(Gantry(), configured) << "not signed yet";
    EXPECT_EQ(Sign(), ChangeResult::kDone);
    ASSERT_TRUE(Gantry());
    EXPECT_LT((*Gantry() - calibrated).norm(), 1e-6);
    EXPECT_THAT(warnings_,
                ::testing::HasSubstr("the axes of the room in the configuration are not used"));

    MarkerMap moved = testing::MarkersOfRoom();
    for (Eigen::Vector3d& corner : moved.at(4).corners) corner.x() += 0.008;
    On([&] {
      (void)shared_->store->checks.Add(erik_, "A", testing::CheckOver(0, 0, moved));
      shared_->room.Refresh();
    });
    EXPECT_FALSE(Gantry()) << "neither the calibration nor the configuration";
    EXPECT_THAT(warnings_, ::testing::HasSubstr("marker 4 moved 8 mm"));
    EXPECT_THAT(services_->services().room.GetRoomCalibration().due.English(),
                ::testing::HasSubstr("marker 4"));
    for (int i = 0; i < 3; ++i) ScanBoard();
    EXPECT_EQ(Sign(), ChangeResult::kDone);
    EXPECT_TRUE(Gantry());
    EXPECT_EQ(services_->services().room.GetRoomCalibration().versions.front().version, 2);
  });
}

TEST_F(ApplianceRoomTest, OnTheMapsOfAReferenceTheRoomLiesAsItsOwnMarkersSay) {
  parts_.config.compare.T_iec_reference = Pose::Identity();
  // The reference marker lay turned by 90 degrees when this reference was scanned.
  const Pose turn(Eigen::AngleAxisd(90 * kDegree, Eigen::Vector3d::UnitZ()));
  MarkerMap turned = testing::MarkersOfRoom();
  for (auto& [id, marker] : turned) {
    for (Eigen::Vector3d& corner : marker.corners) corner = turn * corner;
  }
  MarkerMap two = turned;
  while (two.size() > 2) two.erase(two.begin());
  Play([&] {
    MakeReady();
    const Reference reference = ReferenceOf(turned);
    const auto shown = [&] { return services_->services().references.RoomOfReference(reference); };
    EXPECT_TRUE(shown().is_known);
    EXPECT_EQ(shown().gantry_xy, (std::array<double, 2>{0, 1})) << "as it is configured";
    for (int i = 0; i < 3; ++i) ScanBoard();
    EXPECT_EQ(Sign(), ChangeResult::kDone);
    ASSERT_TRUE(Gantry());
    const Eigen::Vector2d expected = turn.linear().topLeftCorner<2, 2>() * *Gantry();
    ASSERT_TRUE(shown().is_known);
    EXPECT_LT((Eigen::Vector2d(shown().gantry_xy.data()) - expected).norm(), 1e-6);
    EXPECT_LT(
        (Eigen::Vector2d(shown().right_xy.data()) - Eigen::Vector2d(expected.y(), -expected.x()))
            .norm(),
        1e-6);
    const auto ways = shared_->room.In(turned);
    ASSERT_TRUE(ways);
    EXPECT_LT((ways->gantry - expected).norm(), 1e-6) << "the same in the report";
    EXPECT_FALSE(shared_->room.In(two)) << "too few markers: a comparison would not know it";

    MarkerMap moved = testing::MarkersOfRoom();
    for (Eigen::Vector3d& corner : moved.at(4).corners) corner.x() += 0.008;
    On([&] {
      (void)shared_->store->checks.Add(erik_, "A", testing::CheckOver(0, 0, moved));
      shared_->room.Refresh();
    });
    EXPECT_FALSE(shown().is_known) << "it has to be calibrated again";
    EXPECT_FALSE(shared_->room.In(turned));
  });
}

TEST_F(ApplianceRoomTest, WithoutAnyNobodyKnowsTheRoom) {
  Play([&] {
    MakeReady();
    EXPECT_FALSE(Gantry());
    EXPECT_FALSE(shared_->room.In(testing::MarkersOfRoom()));
    EXPECT_EQ(warnings_, "");
    Message why_not;
    EXPECT_EQ(services_->services().room.RoomBoardPdf(why_not).value_or("").substr(0, 5), "%PDF-")
        << why_not.English();
  });
}

}  // namespace
}  // namespace plumb
