// SPDX-License-Identifier: Apache-2.0
// The rules of docs/planning-ct.md, each on the planning CT of a simulated body.
#include "algo/planning/planned_scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "algo/base/errors.hpp"
#include "algo/motion/region.hpp"
#include "drivers/simulator/suites/planned_scenes.hpp"
#include "drivers/simulator/suites/planning_ct.hpp"
#include "tests/unit/planning/torso.hpp"
#include "words/planning.hpp"

namespace plumb {
namespace {

using simulated::CtQuirk;
using simulated::PlanningCtOptions;
using ::testing::Contains;
using testing::PlaceOfTorso;
using testing::Torso;
using ::testing::Truly;

std::pair<StructureSet, TreatmentPlan> Files(const PlanningCtOptions& options) {
  return simulated::MakePlanningCt(Torso().surface, PlaceOfTorso(), options);
}

Scene Import(const PlanningCtOptions& options, const PlanningChoice& choice = {}) {
  const auto [structures, plan] = Files(options);
  return MakePlannedScene(structures, plan, choice);
}

// The message with which an import is refused; empty if it is not.
Message Refusal(const PlanningCtOptions& options, const PlanningChoice& choice = {}) {
  try {
    (void)Import(options, choice);
  } catch (const DataError& error) {
    return error.message();
  }
  return {};
}

auto Says(const MessageId& id) {
  return Contains(Truly([id](const Message& message) { return message.Is(id); }));
}

// The largest distance of a scene's points from the body's true surface, and their number.
std::pair<double, std::size_t> FarthestFromBody(const Scene& scene) {
  const Pose T_body = PlaceOfTorso().inverse();
  double farthest_m = 0.0;
  for (const Eigen::Vector3f& p : scene.cloud.points) {
    const Eigen::Vector3f in_body = (T_body * p.cast<double>()).cast<float>();
    farthest_m = std::max(farthest_m, std::abs(double{Torso().grid->Distance(in_body)}));
  }
  return {farthest_m, scene.cloud.size()};
}

double LowestOfBody() {
  double lowest_m = 0.0;
  for (const Eigen::Vector3f& vertex : Torso().surface.vertices)
    lowest_m = std::min(lowest_m, (PlaceOfTorso() * vertex.cast<double>()).z());
  return lowest_m;
}

TEST(PlannedSceneTest, InEveryPositionTheBodyLiesWhereItDoes) {
  for (const std::string_view position : kNamesOf<PatientPosture>) {
    const Scene scene = Import({.posture = Named<PatientPosture>(position).value(), .phase = 0.3});
    const auto [farthest_m, count] = FarthestFromBody(scene);
    EXPECT_LT(farthest_m, 1.5e-3) << position;
    EXPECT_GT(count, 30000U) << position;
    EXPECT_EQ(scene.frame, SceneFrame::kIec);
    EXPECT_TRUE(scene.markers.empty());
    EXPECT_EQ(Name(scene.planning->posture), position);
    EXPECT_NEAR(scene.planning->support_m, LowestOfBody(), 0.004);
    EXPECT_NEAR(scene.planning->slice_spacing_m, 0.003, 1e-6);
  }
}

TEST(PlannedSceneTest, WhatWritersDoChangesNothing) {
  const Scene plain = Import({});
  for (const CtQuirk quirk : {CtQuirk::kCrumbs, CtQuirk::kHoles, CtQuirk::kClosed, CtQuirk::kPoints,
                              CtQuirk::kDense, CtQuirk::kEmptyRoi}) {
    const Scene scene = Import({.quirks = {quirk}});
    ASSERT_TRUE(scene.height_map) << Name(quirk);
    std::size_t known = 0, same = 0;
    const GridShape& grid = plain.height_map->grid;
    for (int row = 0; row < grid.height; ++row) {
      for (int column = 0; column < grid.width; ++column) {
        const float z = plain.height_map->at(row, column);
        if (!std::isfinite(z)) continue;
        ++known;
        const auto cell = scene.height_map->grid.cell(grid.x_centre(column), grid.y_centre(row));
        same += cell && std::abs(scene.height_map->z[*cell] - z) < 1e-5F ? 1 : 0;
      }
    }
    EXPECT_EQ(same, known) << Name(quirk);
  }
}

TEST(PlannedSceneTest, PartsOfTheCouchAreLeftOutAndSaid) {
  const Scene scene = Import({.quirks = {CtQuirk::kCouchParts}});
  EXPECT_LT(FarthestFromBody(scene).first, 1.5e-3);
  EXPECT_GT(scene.planning->parts_left_out, 100);
  EXPECT_THAT(scene.warnings, Says(say::planning::kCouchParts));
}

TEST(PlannedSceneTest, ACouchInTheContourIsFoundBeneathTheBody) {
  const Scene scene = Import({.quirks = {CtQuirk::kCouch}});
  EXPECT_NEAR(scene.planning->support_m, LowestOfBody() - 0.05, 0.004);
  const auto body = BodyOfScene(scene, SceneCloud(scene, Eigen::Affine3d::Identity()));
  ASSERT_TRUE(body.support);
  EXPECT_NEAR(body.support->offset_m, LowestOfBody(), 0.004);
  // Without it the stated support carries the body.
  const Scene plain = Import({});
  const auto stated = BodyOfScene(plain, SceneCloud(plain, Eigen::Affine3d::Identity()));
  EXPECT_NEAR(stated.support->offset_m, plain.planning->support_m, 1e-9);
}

TEST(PlannedSceneTest, AMissingSliceIsSaid) {
  EXPECT_THAT(Import({.quirks = {CtQuirk::kMissingSlice}}).warnings,
              Says(say::planning::kSliceGaps));
}

TEST(PlannedSceneTest, WideSlicesAreSaidAndWiderOnesRefused) {
  EXPECT_THAT(Import({.spacing_m = 0.005}).warnings, Not(Says(say::planning::kSpacingWide)));
  EXPECT_THAT(Import({.spacing_m = 0.0055}).warnings, Says(say::planning::kSpacingWide));
  EXPECT_TRUE(Refusal({.spacing_m = 0.007}).Is(say::planning::kSpacingTooWide));
}

TEST(PlannedSceneTest, WithoutOneExternalContourAPersonChooses) {
  EXPECT_TRUE(Refusal({.quirks = {CtQuirk::kNoExternal}}).Is(say::planning::kNoExternalPerhaps));
  const Message several = Refusal({.quirks = {CtQuirk::kSeveralExternal}});
  EXPECT_TRUE(several.Is(say::planning::kSeveralExternal));
  EXPECT_THAT(several.English(), ::testing::HasSubstr("the largest is BODY"));
  for (const CtQuirk quirk : {CtQuirk::kNoExternal, CtQuirk::kSeveralExternal})
    EXPECT_EQ(Import({.quirks = {quirk}}, {.roi = "BODY"}).planning->roi, "BODY");
  EXPECT_TRUE(Refusal({}, {.roi = "body"}).Is(say::planning::kNoSuchRoi));
  EXPECT_TRUE(
      Refusal({.quirks = {CtQuirk::kEmptyRoi}}, {.roi = "Skin"}).Is(say::planning::kRoiEmpty));
}

TEST(PlannedSceneTest, TwoIsocentresAreAskedFor) {
  const PlanningCtOptions two = {.quirks = {CtQuirk::kTwoIsocentres}};
  EXPECT_TRUE(Refusal(two).Is(say::planning::kSeveralIsocentres));
  const Scene by_name = Import(two, {.beam = "LAT"}), by_number = Import(two, {.beam = "1"});
  EXPECT_EQ(by_name.planning->beam, "LAT");
  EXPECT_DOUBLE_EQ(by_name.planning->isocentre_mm.x() - by_number.planning->isocentre_mm.x(), 20);
  // Head first supine: the same surface lies 20 mm farther to the left of the isocentre.
  EXPECT_NEAR(by_number.height_map->grid.x_min - by_name.height_map->grid.x_min, 0.020, 1e-9);
  EXPECT_TRUE(Refusal(two, {.beam = "3"}).Is(say::planning::kNoSuchBeam));
}

// The beams of a plan, by name and by how far their isocentres lie from the first one's, mm. They
// have the numbers from 1 on.
TreatmentPlan PlanWith(TreatmentPlan plan, const std::vector<std::pair<std::string, int>>& beams) {
  const PlannedBeam first = plan.beams.front();
  plan.beams.clear();
  for (const auto& [name, off_mm] : beams) {
    PlannedBeam& beam = plan.beams.emplace_back(first);
    beam.name = name;
    beam.number = static_cast<std::int64_t>(plan.beams.size());
    beam.isocentre_mm->x() += off_mm;
  }
  return plan;
}

TEST(PlannedSceneTest, ABeamIsChosenByItsNameBeforeAnyNumber) {
  const auto [structures, plan] = Files({});
  const TreatmentPlan renumbered = PlanWith(plan, {{"3", 0}, {"2", 10}, {"1", 20}});
  for (const auto& [choice, off_mm] : {std::pair{"3", 0}, {"2", 10}, {"1", 20}}) {
    const Scene scene = MakePlannedScene(structures, renumbered, {.beam = choice});
    EXPECT_EQ(scene.planning->beam, choice);
    EXPECT_DOUBLE_EQ(scene.planning->isocentre_mm.x(), plan.beams[0].isocentre_mm->x() + off_mm);
  }
}

TEST(PlannedSceneTest, ANameOfSeveralBeamsIsTakenOnlyWhereTheirIsocentreIsOne) {
  const auto [structures, plan] = Files({});
  const auto refusal = [&](const TreatmentPlan& changed, const std::string& choice) {
    try {
      (void)MakePlannedScene(structures, changed, {.beam = choice});
    } catch (const DataError& error) {
      return error.message();
    }
    return Message();
  };
  const TreatmentPlan twice = PlanWith(plan, {{"AP", 0}, {"AP", 10}, {"LAT", 20}});
  EXPECT_EQ(refusal(twice, "AP"), say::planning::BeamTwice("AP", {"1", "2"}));
  const Scene second = MakePlannedScene(structures, twice, {.beam = "2"});
  EXPECT_EQ(second.planning->beam, "AP (2)");
  EXPECT_DOUBLE_EQ(second.planning->isocentre_mm.x(), plan.beams[0].isocentre_mm->x() + 10);
  EXPECT_TRUE(refusal(PlanWith(plan, {{"AP", 0}, {"AP", 0}, {"LAT", 20}}), "AP").empty());
  // The number that the refusal asks for is the name of another beam.
  const TreatmentPlan entangled = PlanWith(plan, {{"AP", 0}, {"AP", 10}, {"1", 20}});
  EXPECT_EQ(refusal(entangled, "1"), say::planning::BeamTwice("1", {"3", "1"}));
  EXPECT_TRUE(refusal(entangled, "3").empty());
}

TEST(PlannedSceneTest, FilesThatDoNotBelongTogetherAreRefused) {
  const auto refused = [](CtQuirk quirk) { return Refusal({.quirks = {quirk}}); };
  EXPECT_TRUE(refused(CtQuirk::kOtherFrame).Is(say::planning::kOtherFrame));
  EXPECT_TRUE(refused(CtQuirk::kOtherPatient).Is(say::planning::kOtherPatient));
  EXPECT_TRUE(refused(CtQuirk::kSuperseded).Is(say::planning::kSuperseded));
  EXPECT_TRUE(refused(CtQuirk::kRejected).Is(say::planning::kRejected));
  EXPECT_TRUE(refused(CtQuirk::kDecubitus).Is(say::planning::kPositionRefused));
  EXPECT_TRUE(refused(CtQuirk::kTwoPositions).Is(say::planning::kPositionsDiffer));
  EXPECT_TRUE(refused(CtQuirk::kOblique).Is(say::planning::kOblique));
  EXPECT_TRUE(refused(CtQuirk::kLostPoints).Is(say::planning::kPointsLost));
}

// What a change of the files is refused with; empty if it is not.
template <typename Change>
Message RefusalAfter(const Change& change) {
  auto [structures, plan] = Files({});
  change(structures, plan);
  try {
    (void)MakePlannedScene(structures, plan);
  } catch (const DataError& error) {
    return error.message();
  }
  return {};
}

TEST(PlannedSceneTest, PlansThatCannotPlaceThePatientAreRefused) {
  using S = StructureSet&;
  using P = TreatmentPlan&;
  namespace p = say::planning;
  EXPECT_TRUE(RefusalAfter([](S, P) {}).empty());
  EXPECT_TRUE(RefusalAfter([](S, P plan) { plan.geometry = "TREATMENT_DEVICE"; }).Is(p::kGeometry));
  EXPECT_TRUE(RefusalAfter([](S, P plan) { plan.setups.clear(); }).Is(p::kPositionMissing));
  EXPECT_TRUE(RefusalAfter([](S, P plan) { plan.beams.clear(); }).Is(p::kNoIsocentre));
  EXPECT_TRUE(RefusalAfter([](S, P plan) { plan.beams[1].pitch_deg = 0.06; }).Is(p::kCouchTilted));
  EXPECT_TRUE(RefusalAfter([](S, P plan) { plan.beams[0].roll_deg = -1; }).Is(p::kCouchTilted));
  EXPECT_TRUE(RefusalAfter([](S, P plan) { plan.beams[0].pitch_deg = 5e-9; }).empty());
  EXPECT_TRUE(RefusalAfter([](S structures, P) { structures.rois.clear(); }).Is(p::kNoContours));
  EXPECT_TRUE(RefusalAfter([](S structures, P) {
                structures.rois[0].contours.resize(3);
              }).Is(p::kFewSlices));
  EXPECT_TRUE(RefusalAfter([](S structures, P) {
                // To and fro, as no outline runs.
                PlannedContour& contour = structures.rois[0].contours[20];
                const double z_mm = contour.points_mm.front().z();
                contour.points_mm = {{-200, -500, z_mm}, {200, -500, z_mm}, {200, -450, z_mm}};
                for (int i = 2; i < 200; ++i)
                  contour.points_mm.emplace_back(i % 2 == 0 ? -200 : 200, i - 450, z_mm);
                contour.stated_points = -1;
              }).Is(p::kContoursRagged));
  EXPECT_TRUE(RefusalAfter([](S, P plan) {
                for (PlannedBeam& beam : plan.beams) beam.isocentre_mm->y() += 5000;
              }).Is(p::kFarAway));
  EXPECT_TRUE(RefusalAfter([](S structures, P plan) {
                structures.file.frame_of_reference_uid.clear();
                structures.rois[0].frame_of_reference_uid.clear();
                plan.file.frame_of_reference_uid = "2.25.52";
              }).Is(p::kFrameMissing));
}

TEST(PlannedSceneTest, WhatIsNotAppliedIsSaid) {
  auto [structures, plan] = Files({});
  plan.approval = "UNAPPROVED";
  plan.beams[1].couch_deg = 270.0;
  plan.setups[0].has_displacement = true;
  const Scene scene = MakePlannedScene(structures, plan);
  for (const MessageId& id : {say::planning::kUnapproved, say::planning::kCouchTurns,
                              say::planning::kDisplacement, say::planning::kSkinUnknown})
    EXPECT_THAT(scene.warnings, Says(id)) << id.name;
}

}  // namespace
}  // namespace plumb
