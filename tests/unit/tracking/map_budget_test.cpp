// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/map_budget.hpp"

#include <gtest/gtest.h>

#include "algo/reconstruction/trajectory.hpp"

namespace plumb {
namespace {

std::vector<std::size_t> WithImages(const TrackingMap& map) {
  std::vector<std::size_t> with_images;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    if (!map.keyframes[k].is_bare) with_images.push_back(k);
  return with_images;
}

// A straight way of 10 cm steps, and keyframe 5 in the middle of one.
TrackingMap Way(int num_keyframes) {
  TrackingMap map;
  for (int k = 0; k < num_keyframes; ++k) {
    MapKeyframe keyframe;
    keyframe.T_world_color.translation().x() = k < 5 ? 0.1 * k : k == 5 ? 0.45 : 0.1 * (k - 1);
    keyframe.data.view.depth_m = cv::Mat(12, 16, CV_32FC1, cv::Scalar(1.0));
    keyframe.data.view.color_rgb = cv::Mat(12, 16, CV_8UC3);
    keyframe.data.markers.resize(1);
    keyframe.gray = cv::Mat(12, 16, CV_8UC1);
    keyframe.descriptors = cv::Mat(3, 32, CV_8UC1);
    keyframe.dense.z_m.assign(12, 1.0F);
    keyframe.keypoints.resize(7);
    map.keyframes.push_back(keyframe);
  }
  return map;
}

TEST(ImageBudget, KeepsAllUpToTheLimitAndThenGivesUpTheViewThatIsLeastMissed) {
  TrackingMap map = Way(30);
  BoundImages(30, map);
  EXPECT_EQ(WithImages(map).size(), 30U);

  BoundImages(29, map);
  EXPECT_EQ(WithImages(map).size(), 29U);
  const MapKeyframe& given_up = map.keyframes[5];
  EXPECT_TRUE(given_up.data.view.depth_m.empty()) << "between two that are 10 cm apart";
  EXPECT_TRUE(given_up.data.view.color_rgb.empty());
  EXPECT_TRUE(given_up.gray.empty());
  EXPECT_TRUE(given_up.descriptors.empty());
  EXPECT_TRUE(given_up.data.markers.empty());
  EXPECT_EQ(given_up.dense.size(), 0U);
  EXPECT_EQ(given_up.keypoints.size(), 7U) << "what it saw still holds its place";
}

TEST(ImageBudget, KeepsTheFirstAndTheNewestWhateverTheLimit) {
  TrackingMap map = Way(30);
  BoundImages(1, map);
  const std::vector<std::size_t> kept = WithImages(map);
  ASSERT_EQ(kept.size(), 1 + kNewestKept);
  EXPECT_EQ(kept.front(), 0U);
  EXPECT_EQ(kept[1], 30 - kNewestKept);
}

// What is given up is spread over the way, so that every place is still seen.
TEST(ImageBudget, LeavesNoGapsAsASweepGrows) {
  TrackingMap map;
  const TrackingMap way = Way(200);
  for (const MapKeyframe& keyframe : way.keyframes) {
    map.keyframes.push_back(keyframe);
    BoundImages(50, map);
    ASSERT_LE(WithImages(map).size(), 50U);
  }
  const std::vector<std::size_t> kept = WithImages(map);
  for (std::size_t i = 1; i < kept.size(); ++i)
    EXPECT_LE(kept[i] - kept[i - 1], 10U) << "after " << kept[i - 1];
}

struct Sweep {
  TrackingMap map;
  std::vector<TrackedFrame> frames;
};

// A straight way with a frame for each keyframe and one after it. All keyframes observe one
// landmark.
Sweep MakeSweep(int num_keyframes) {
  Sweep sweep{Way(num_keyframes), {}};
  sweep.map.landmarks.resize(1);
  for (const MapKeyframe& keyframe : sweep.map.keyframes)
    sweep.map.landmarks[0].num_observations += static_cast<int>(keyframe.keypoints.size());
  for (int k = 0; k < num_keyframes; ++k) {
    MapKeyframe& keyframe = sweep.map.keyframe(k);
    TrackedFrame frame;
    frame.tracked = true;
    frame.color_time_s = k;
    frame.keyframe = frame.reference_keyframe = k;
    if (k > 0) {
      const MapKeyframe& before = sweep.map.keyframe(k - 1);
      keyframe.previous = frame.previous_keyframe = k - 1;
      keyframe.T_previous_color = frame.T_previous_color =
          before.T_world_color.inverse() * keyframe.T_world_color;
    }
    sweep.frames.push_back(frame);
    frame.keyframe.reset();
    frame.previous_keyframe.reset();
    frame.color_time_s = k + 0.5;
    frame.T_reference_color.translation().x() = 0.04;
    sweep.frames.push_back(frame);
  }
  return sweep;
}

// Returns the path before.
std::vector<Pose> Bound(std::size_t max_images, std::size_t max_keyframes, Sweep& sweep) {
  const std::vector<Pose> path = ColorPoses(sweep.frames, sweep.map);
  BoundImages(max_images, sweep.map);
  BoundKeyframes(max_keyframes, path, sweep.frames, sweep.map);
  return path;
}

TEST(KeyframeBudget, LeavesASweepWithinTheLimitAsItIs) {
  Sweep sweep = MakeSweep(30);
  Bound(20, 30, sweep);
  EXPECT_EQ(sweep.map.keyframes.size(), 30U);
  EXPECT_EQ(sweep.frames[11].reference_keyframe, 5);
}

TEST(KeyframeBudget, AKeyframeThatIsGivenUpBecomesAFrameOfTheSamePath) {
  Sweep sweep = MakeSweep(30);
  auto& [map, frames] = sweep;
  // Keyframes are adjusted after they were tracked: this one and the next differ from that.
  map.keyframes[5].T_world_color.translation().y() += 0.002;
  map.keyframes[6].T_world_color.translation().y() += 0.003;
  const std::vector<Pose> path = Bound(29, 29, sweep);
  ASSERT_EQ(map.keyframes.size(), 29U);
  EXPECT_EQ(map.landmarks[0].num_observations, 29 * 7) << "one keyframe less observes it";
  EXPECT_FALSE(frames[10].keyframe) << "it lay between two that are 10 cm apart";
  EXPECT_EQ(frames[10].reference_keyframe, 4);
  EXPECT_EQ(frames[11].reference_keyframe, 4);
  EXPECT_EQ(frames[12].keyframe, 5);
  EXPECT_EQ(frames[12].previous_keyframe, 4);
  EXPECT_EQ(map.keyframes[5].previous, 4);
  const std::vector<Pose> after = ColorPoses(frames, map);
  for (std::size_t i = 0; i < path.size(); ++i)
    EXPECT_NEAR((after[i].translation() - path[i].translation()).norm(), 0.0, 1e-12) << i;
}

TEST(KeyframeBudget, KeepsThePathWhereSeveralInARowAreGivenUp) {
  Sweep sweep = MakeSweep(60);
  for (std::size_t k = 1; k < 60; ++k)
    sweep.map.keyframes[k].T_world_color.translation().y() += 0.001 * static_cast<double>(k % 7);
  const std::vector<Pose> path = Bound(15, 16, sweep);
  ASSERT_EQ(sweep.map.keyframes.size(), 16U);
  EXPECT_EQ(sweep.map.landmarks[0].num_observations, 16 * 7);
  for (std::size_t k = 1; k < 16; ++k)
    EXPECT_EQ(sweep.map.keyframes[k].previous, static_cast<int>(k - 1)) << k;
  const std::vector<Pose> after = ColorPoses(sweep.frames, sweep.map);
  for (std::size_t i = 0; i < path.size(); ++i)
    EXPECT_NEAR((after[i].translation() - path[i].translation()).norm(), 0.0, 1e-12) << i;
}

TEST(KeyframeBudget, KeepsTheFirstKeyframeAfterTrackingWasLost) {
  Sweep sweep = MakeSweep(30);
  auto& [map, frames] = sweep;
  map.keyframes[5].previous = frames[10].previous_keyframe = 2;
  map.keyframes[5].T_previous_color = frames[10].T_previous_color =
      map.keyframes[2].T_world_color.inverse() * map.keyframes[5].T_world_color;
  Bound(29, 29, sweep);
  EXPECT_EQ(map.keyframes.size(), 30U);
  EXPECT_EQ(frames[10].keyframe, 5);
}

TEST(KeyframeBudget, GivesUpNoneThatHasImages) {
  Sweep sweep = MakeSweep(40);
  Bound(30, 20, sweep);
  EXPECT_EQ(sweep.map.keyframes.size(), 30U);
  EXPECT_EQ(WithImages(sweep.map).size(), 30U);
}

}  // namespace
}  // namespace plumb
