// SPDX-License-Identifier: Apache-2.0
// What is known of a sensor unit, on its way into a scan and out of it.
#include "daemon/scanning/unit_profile.hpp"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/pipeline/learning_gate.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;

constexpr int kFocal = kLensAt;

Intrinsics Stated() {
  Intrinsics stated;
  stated.width = 640;
  stated.height = 480;
  return stated;
}

SensorProfile Profile(double focal) {
  SensorProfile profile = ProfileOfAnyUnit(Stated());
  profile.mean[kFocal] = focal;
  profile.covariance(kFocal, kFocal) = 1e-8;
  profile.num_sweeps = 2;
  return profile;
}

class UnitProfileTest : public ::testing::Test {
 protected:
  /// As a sweep under the options that found this focal length.
  static void Sweep(const ReconstructorOptions& options, double focal) {
    SensorProfile learned = options.profile.value_or(ProfileOfAnyUnit(Stated()));
    learned.mean[kFocal] = focal;
    learned.covariance.diagonal() += DriftBetweenSweeps().cwiseAbs2();
    learned.covariance(kFocal, kFocal) = 0.5e-8;
    ++learned.num_sweeps;
    options.on_learned(learned);
  }
  [[nodiscard]] UnitProfile Of(const std::string& serial) const {
    return {shelf_, serial, Stated()};
  }

  testing::TempFolder folder_;
  std::shared_ptr<ProfileShelf> shelf_ = std::make_shared<ProfileShelf>(folder_ / "profiles");
  ReconstructorOptions options_;
};

TEST_F(UnitProfileTest, AScanBeginsFromTheProfileOfItsOwnUnit) {
  (void)shelf_->Add("A", Profile(0.001));
  UnitProfile own = Of("A"), other = Of("B");
  own.Begin(options_);
  ASSERT_TRUE(options_.profile);
  EXPECT_EQ(options_.profile->mean[kFocal], 0.001);
  EXPECT_EQ(options_.profile->name, "A version 1");
  other.Begin(options_);
  EXPECT_FALSE(options_.profile);
}

TEST_F(UnitProfileTest, TheFirstSweepMakesTheFirstVersionAndTheNextJoinsIt) {
  UnitProfile first = Of("A");
  first.Begin(options_);
  EXPECT_FALSE(options_.profile);
  Sweep(options_, 0.001);
  EXPECT_EQ(first.Drift().English(), "");
  first.LearnFromScan();
  UnitProfile second = Of("A");
  second.Begin(options_);
  EXPECT_EQ(options_.profile.value().num_sweeps, 1);
  Sweep(options_, 0.0011);
  second.LearnFromScan();
  EXPECT_EQ(shelf_->Read("A").newest.value().profile.value().num_sweeps, 2);
  EXPECT_EQ(shelf_->Versions("A").size(), 2U);
}

TEST_F(UnitProfileTest, ASweepBeyondTheGateIsNotJoinedAndReported) {
  (void)shelf_->Add("A", Profile(0.001));
  // The mean's move has the variance 1e-8 (known) + 1e-8 (drift) - 0.5e-8 (left): one term, a limit
  // of 11.33, so 0.000412 is the boundary.
  UnitProfile within = Of("A");
  within.Begin(options_);
  Sweep(options_, 0.001 + 0.00040);
  EXPECT_EQ(within.Drift().English(), "");
  within.LearnFromScan();
  EXPECT_EQ(shelf_->Versions("A").size(), 2U);
  (void)shelf_->RollBack("A", 1);
  UnitProfile beyond = Of("A");
  beyond.Begin(options_);
  Sweep(options_, 0.001 + 0.00043);
  EXPECT_THAT(beyond.Drift().English(), HasSubstr("sensor A no longer agrees with its profile"));
  EXPECT_THAT(beyond.Drift().English(), HasSubstr("on the settings page"));
  beyond.LearnFromScan();
  EXPECT_EQ(shelf_->Versions("A").size(), 3U) << "nothing was added";
  EXPECT_EQ(shelf_->Read("A").newest.value().profile.value().mean[kFocal], 0.001);
}

TEST_F(UnitProfileTest, ASweepThatLearnedNothingTeachesNothing) {
  UnitProfile unit = Of("A");
  unit.Begin(options_);
  EXPECT_EQ(unit.Drift().English(), "");
  unit.LearnFromScan();
  EXPECT_FALSE(shelf_->Read("A").newest);
}

TEST_F(UnitProfileTest, AProfileOfAnotherCalibrationFileIsNotUsedAndANewOneIsBegun) {
  SensorProfile other = Profile(0.001);
  other.stated.fx += 1;
  (void)shelf_->Add("A", other);
  UnitProfile unit = Of("A");
  unit.Begin(options_);
  EXPECT_FALSE(options_.profile);
  Sweep(options_, 0.002);
  unit.LearnFromScan();
  const SensorProfile now = shelf_->Read("A").newest.value().profile.value();
  EXPECT_EQ(now.stated, Stated());
  EXPECT_EQ(now.num_sweeps, 1);
}

TEST_F(UnitProfileTest, WhatWasResetDuringTheSweepStaysReset) {
  (void)shelf_->Add("A", Profile(0.001));
  UnitProfile unit = Of("A");
  unit.Begin(options_);
  Sweep(options_, 0.001);
  (void)shelf_->Reset("A");
  unit.LearnFromScan();
  EXPECT_FALSE(shelf_->Read("A").newest.value().profile);
}

TEST_F(UnitProfileTest, ADamagedProfileIsDoneWithout) {
  (void)shelf_->Add("A", Profile(0.001));
  std::ofstream(folder_ / "profiles" / "A" / "000001.profile") << "nothing";
  UnitProfile unit = Of("A");
  unit.Begin(options_);
  EXPECT_FALSE(options_.profile);
  EXPECT_TRUE(options_.on_learned);
}

TEST_F(UnitProfileTest, ADiskThatCannotBeWrittenDoesNotFailTheScan) {
  std::ofstream(folder_ / "profiles") << "a file where the folder should be";
  UnitProfile unit = Of("A");
  unit.Begin(options_);
  Sweep(options_, 0.001);
  ::testing::internal::CaptureStderr();
  EXPECT_NO_THROW(unit.LearnFromScan());
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), HasSubstr("by this sweep is lost"));
}

TEST(WhyNotLearned, NamesEachCheckThatAScanHasToPass) {
  AcceptanceLimits limits;
  Scene scene;
  for (int id = 0; id < limits.min_shared_markers; ++id) scene.markers[id] = {};
  scene.longest_lost_s = limits.max_lost_s;
  EXPECT_TRUE(WhyNotLearned(scene, {}, limits).empty());
  EXPECT_TRUE(WhyNotLearned(scene, Verdict::kMove, limits).empty());
  EXPECT_THAT(WhyNotLearned(scene, Verdict::kNoAnswer, limits).English(), HasSubstr("no answer"));
  Scene lost = scene;
  lost.longest_lost_s = limits.max_lost_s + 0.01;
  EXPECT_THAT(WhyNotLearned(lost, {}, limits).English(), HasSubstr("lost"));
  Scene breathing = scene;
  breathing.breathing = Breathing{.amplitude_m = limits.max_breathing_m};
  EXPECT_TRUE(WhyNotLearned(breathing, {}, limits).empty());
  breathing.breathing->amplitude_m += 1e-6;
  EXPECT_THAT(WhyNotLearned(breathing, {}, limits).English(), HasSubstr("rose and fell"));
  Scene few = scene;
  few.markers.erase(0);
  EXPECT_THAT(WhyNotLearned(few, {}, limits).English(), HasSubstr("markers"));
}

}  // namespace
}  // namespace plumb
