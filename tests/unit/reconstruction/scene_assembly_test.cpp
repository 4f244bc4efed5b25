// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/scene_assembly.hpp"

#include <cstdint>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/tracking/loop_closer.hpp"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(SceneAssemblyTest, WhatIsWrongWithASweepStaysWithItsScene) {
  Symptoms symptoms;
  symptoms.marker_depths = {{.id = 7, .ratio = 0.97, .scatter = 0.01, .num_views = 9}};
  symptoms.marker_length_m = 0.104;
  Scene scene;
  AddFindings(symptoms, scene);
  EXPECT_THAT(EnglishTexts(scene.warnings), ElementsAre(HasSubstr("disagree by 3.0 %")));
  EXPECT_THAT(scene.refusals, IsEmpty());
  EXPECT_NEAR(scene.scale_doubt, 0.03 + 0.01, 1e-9);
  symptoms.marker_depths[0].ratio = 5.0;
  Scene refused;
  AddFindings(symptoms, refused);
  EXPECT_THAT(EnglishTexts(refused.refusals), ElementsAre(HasSubstr("depth_scale")));
  EXPECT_EQ(refused.warnings, refused.refusals);
}

// Warnings of a scene from this many keyframes, of which each sees a landmark together with the
// next only.
std::vector<std::string> Warnings(int num_keyframes, std::int64_t num_dropped, bool returns,
                                  std::size_t num_fewer_keypoints = 0) {
  TrackingMap map;
  for (int k = 0; k < num_keyframes; ++k) {
    MapKeyframe& keyframe = map.keyframes.emplace_back();
    for (const int landmark : {k, k + 1}) keyframe.keypoints.emplace_back().landmark = landmark;
  }
  if (returns)
    for (const std::size_t k : {std::size_t{2}, std::size_t{2 + kLoopMinGap}})
      map.keyframes.at(k).data.markers.emplace_back().id = 7;
  std::vector<TrackedFrame> frames(95);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].color_time_s = frames[i].depth_time_s = static_cast<double>(i) / 30.0;
    frames[i].tracked = true;
    frames[i].reference_keyframe = 0;
    frames[i].fewer_keypoints = i < num_fewer_keypoints;
  }
  return EnglishTexts(
      MakeScene({.info = {}, .num_dropped = num_dropped, .frames = frames, .map = map}).warnings);
}

TEST(SceneAssemblyTest, ASweepThatNeverReturnsToAPlaceIsAWarning) {
  EXPECT_THAT(Warnings(2 * kLoopMinGap + 1, 0, false),
              ElementsAre(HasSubstr("never returned to a place")));
  EXPECT_THAT(Warnings(2 * kLoopMinGap + 1, 0, true), IsEmpty());
  EXPECT_THAT(Warnings(2 * kLoopMinGap, 0, false), IsEmpty()) << "too short to return";
}

TEST(SceneAssemblyTest, AMarkerWithoutAVarianceIsVague) {
  TrackingMap map;
  map.keyframes.resize(1);
  map.markers[3] = map.markers[4] = {.num_views = 2};
  StreamInfo info;
  info.room_markers.length_m = 0.104;
  const std::vector<TrackedFrame> frames(1);
  const Scene scene =
      MakeScene({.info = info, .frames = frames, .map = map, .marker_sigmas_m = {{3, 0.0004}}});
  EXPECT_EQ(scene.markers.at(3).sigma_m, 0.0004);
  EXPECT_EQ(scene.markers.at(4).sigma_m, 0.01);
}

TEST(SceneAssemblyTest, MoreThanOneDroppedFrameInTwentyIsAWarning) {
  EXPECT_THAT(Warnings(2, 5, false), IsEmpty());  // 5 of 100.
  EXPECT_THAT(Warnings(2, 6, false), ElementsAre(HasSubstr("6 of 101 frames were dropped")));
}

TEST(SceneAssemblyTest, EveryFrameWithFewerKeypointsIsCountedAndTold) {
  EXPECT_THAT(Warnings(2, 0, false, 0), IsEmpty());
  EXPECT_THAT(Warnings(2, 0, false, 1),
              ElementsAre(HasSubstr("1 of 95 frames were tracked with fewer keypoints")));
}

TEST(SceneAssemblyTest, BreathingOfOverTwoMillimetresIsAWarning) {
  const auto warnings_at = [](double rise_m) {
    Scene scene;
    scene.breathing = Breathing{.amplitude_m = rise_m, .period_s = 3.9};
    WarnOfBreathing(scene);
    return EnglishTexts(scene.warnings);
  };
  EXPECT_THAT(warnings_at(0.002), IsEmpty());
  EXPECT_THAT(warnings_at(0.0042),
              ElementsAre(HasSubstr("rose and fell by 4.2 mm during the sweep, every 3.9 s")));
  Scene silent;
  WarnOfBreathing(silent);
  EXPECT_THAT(silent.warnings, IsEmpty());
}

}  // namespace
}  // namespace plumb
