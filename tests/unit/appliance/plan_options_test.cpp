// SPDX-License-Identifier: Apache-2.0
// What a person approves must be what a scan is judged by: every field of the plan, each unlike its
// default and unlike what the room is configured with.
#include "daemon/appliance/plan_options.hpp"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;
using testing::MessageOf;

ReferencePlan UnlikeTheDefaults() {
  return {.region_m = {{0.11, 0.12}, {0.51, 0.13}, {0.52, 0.43}, {0.14, 0.44}},
          .isocentre_m = {{0.31, -0.22, 0.07}},
          .tolerance = {.shift_mm = 7.5, .rotation_deg = 2.25},
          .posture = "FFP",
          .couch_markers = true,
          .clothing_mm = 4.5,
          .ct_breathing_mm = 6.25};
}

/// Unlike the defaults and unlike the plan in everything.
CompareOptions UnlikeThePlan() {
  CompareOptions room;
  room.preset = Preset::kPaper;
  room.region_polygon_m = {{9, 9}, {8, 9}, {8, 8}};
  room.isocentre_m = Eigen::Vector3d(9, 9, 9);
  room.T_iec_reference = Pose(Eigen::Translation3d(1, 2, 3));
  room.marker_kind = MarkerKind::kRoom;
  room.posture = PatientPosture::kHeadFirstProne;
  room.markers = {.moved_m = 0.004, .moved_sigmas = 2.5};
  room.limits = {.shift_tolerance_m = 0.042,
                 .rotation_tolerance_rad = 0.42,
                 .min_shared_markers = 5,
                 .min_coverage = 0.83,
                 .max_hole_m = 0.031,
                 .max_residual_p95_m = 0.017,
                 .max_lost_s = 0.6};
  return room;
}

TEST(PlanOptionsTest, EveryFieldOfThePlanReachesTheComparison) {
  ReferencePlan plan = UnlikeTheDefaults();
  // A field that is added to the plan does not compile here until it has a line below.
  const auto& [region_m, isocentre_m, tolerance, posture, couch_markers, clothing_mm,
               ct_breathing_mm] = plan;
  const auto& [shift_mm, rotation_deg] = tolerance;
  (void)region_m, (void)isocentre_m, (void)posture, (void)couch_markers, (void)shift_mm,
      (void)rotation_deg, (void)clothing_mm, (void)ct_breathing_mm;
  const CompareOptions options = CompareOptionsFor(plan, UnlikeThePlan());
  ASSERT_EQ(options.region_polygon_m.size(), 4U);
  EXPECT_EQ(options.region_polygon_m[0], Eigen::Vector2d(0.11, 0.12));
  EXPECT_EQ(options.region_polygon_m[3], Eigen::Vector2d(0.14, 0.44));
  ASSERT_TRUE(options.isocentre_m);
  EXPECT_EQ(*options.isocentre_m, Eigen::Vector3d(0.31, -0.22, 0.07));
  EXPECT_DOUBLE_EQ(options.limits.shift_tolerance_m, 0.0075) << "7.5 mm in metres";
  EXPECT_DOUBLE_EQ(options.limits.rotation_tolerance_rad, 0.039269908169872414)
      << "2.25 degrees in radians";
  EXPECT_EQ(options.posture, PatientPosture::kFeetFirstProne);
  EXPECT_EQ(options.marker_kind, MarkerKind::kCouch);
  ASSERT_TRUE(options.surface);
  EXPECT_DOUBLE_EQ(options.surface->clothing_u95_m, 0.0045);
  EXPECT_DOUBLE_EQ(options.surface->ct_breathing_u95_m, 0.00625);
}

TEST(PlanOptionsTest, WhatNobodyCanHaveStatedOfTheSurfaceIsRefused) {
  for (const double wrong : {-0.1, 100.1, std::numeric_limits<double>::quiet_NaN()}) {
    for (double ReferencePlan::*field :
         {&ReferencePlan::clothing_mm, &ReferencePlan::ct_breathing_mm}) {
      ReferencePlan plan;
      plan.*field = wrong;
      EXPECT_THROW((void)CompareOptionsFor(plan, {}), DataError) << wrong;
      plan.*field = 100;
      EXPECT_NO_THROW((void)CompareOptionsFor(plan, {}));
    }
  }
}

TEST(PlanOptionsTest, WhatIsTheRoomsStaysAsConfigured) {
  const CompareOptions room = UnlikeThePlan();
  const CompareOptions options = CompareOptionsFor(UnlikeTheDefaults(), room);
  EXPECT_EQ(options.preset, Preset::kPaper);
  EXPECT_EQ(options.T_iec_reference->translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(options.markers.moved_m, 0.004);
  EXPECT_EQ(options.markers.moved_sigmas, 2.5);
  EXPECT_EQ(options.limits.min_shared_markers, 5);
  EXPECT_EQ(options.limits.min_coverage, 0.83);
  EXPECT_EQ(options.limits.max_hole_m, 0.031);
  EXPECT_EQ(options.limits.max_residual_p95_m, 0.017);
  EXPECT_EQ(options.limits.max_lost_s, 0.6);
}

TEST(PlanOptionsTest, WhatThePlanLeavesOpenIsNotFilledFromTheRoom) {
  const CompareOptions options = CompareOptionsFor(ReferencePlan{}, UnlikeThePlan());
  EXPECT_TRUE(options.region_polygon_m.empty());
  EXPECT_FALSE(options.isocentre_m);
  EXPECT_EQ(options.marker_kind, MarkerKind::kRoom);
  EXPECT_EQ(options.posture, PatientPosture::kHeadFirstSupine);
  EXPECT_DOUBLE_EQ(options.limits.shift_tolerance_m, 0.003);
  EXPECT_DOUBLE_EQ(options.limits.rotation_tolerance_rad, 0.017453292519943295);
}

TEST(PlanOptionsTest, EachPostureIsItsOwn) {
  const std::pair<const char*, PatientPosture> kPostures[] = {
      {"HFS", PatientPosture::kHeadFirstSupine},
      {"HFP", PatientPosture::kHeadFirstProne},
      {"FFS", PatientPosture::kFeetFirstSupine},
      {"FFP", PatientPosture::kFeetFirstProne}};
  for (const auto& [name, posture] : kPostures) {
    EXPECT_EQ(CompareOptionsFor({.region_m = {},
                                 .isocentre_m = {},
                                 .tolerance = {},
                                 .posture = name,
                                 .couch_markers = false},
                                {})
                  .posture,
              posture)
        << name;
  }
}

TEST(PlanOptionsTest, APlanThatMakesNoSenseIsRefusedWithItsField) {
  const auto complaint = [](const std::function<void(ReferencePlan&)>& spoil) {
    ReferencePlan plan = UnlikeTheDefaults();
    spoil(plan);
    return MessageOf<DataError>([&] { (void)CompareOptionsFor(plan, {}); });
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(complaint([](auto& plan) { plan.posture = "HFX"; }), HasSubstr("posture"));
  EXPECT_THAT(complaint([](auto& plan) { plan.posture = ""; }), HasSubstr("posture"));
  EXPECT_THAT(complaint([](auto& plan) { plan.tolerance.shift_mm = 0; }),
              HasSubstr("shift_tolerance_mm"));
  EXPECT_THAT(complaint([](auto& plan) { plan.tolerance.rotation_deg = kNan; }),
              HasSubstr("rotation_tolerance_deg"));
  EXPECT_THAT(complaint([](auto& plan) { plan.region_m.resize(2); }), HasSubstr("region_m"));
  EXPECT_THAT(complaint([](auto& plan) { plan.region_m[1][0] = kNan; }), HasSubstr("region_m"));
  EXPECT_THAT(complaint([](auto& plan) {
                plan.isocentre_m = {{0, kNan, 0}};
              }),
              HasSubstr("isocentre_m"));
}

}  // namespace
}  // namespace plumb
