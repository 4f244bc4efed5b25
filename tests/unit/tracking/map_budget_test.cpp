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

// A frame for each keyframe and one after it, tracked against the keyframe before.
std::vector<TrackedFrame> FramesOf(TrackingMap& map) {
  std::vector<TrackedFrame> frames;
  for (int k = 0; k < static_cast<int>(map.keyframes.size()); ++k) {
    MapKeyframe& keyframe = map.keyframes[static_cast<std::size_t>(k)];
    TrackedFrame frame;
    frame.tracked = true;
    frame.color_time_s = k;
    frame.keyframe = frame.reference_keyframe = k;
    if (k > 0) {
      const MapKeyframe& before = map.keyframes[static_cast<std::size_t>(k - 1)];
      keyframe.previous = frame.previous_keyframe = k - 1;
      keyframe.T_previous_color = frame.T_previous_color =
          before.T_world_color.inverse() * keyframe.T_world_color;
    }
    frames.push_back(frame);
    frame.keyframe.reset();
    frame.previous_keyframe.reset();
    frame.color_time_s = k + 0.5;
    frame.T_reference_color.translation().x() = 0.04;
    frames.push_back(frame);
  }
  return frames;
}

TEST(KeyframeBudget, LeavesASweepWithinTheLimitAsItIs) {
  TrackingMap map = Way(30);
  map.landmarks.resize(1);
  std::vector<TrackedFrame> frames = FramesOf(map);
  BoundImages(20, map);
  BoundKeyframes(30, ColorPoses(frames, map), frames, map);
  EXPECT_EQ(map.keyframes.size(), 30U);
  EXPECT_EQ(frames[11].reference_keyframe, 5);
}

TEST(KeyframeBudget, AKeyframeThatIsGivenUpBecomesAFrameOfTheSamePath) {
  TrackingMap map = Way(30);
  map.landmarks.resize(1);
  map.landmarks[0].num_observations = 30 * 7;
  std::vector<TrackedFrame> frames = FramesOf(map);
  // Keyframes are adjusted after they were tracked: this one and the next differ from that.
  map.keyframes[5].T_world_color.translation().y() += 0.002;
  map.keyframes[6].T_world_color.translation().y() += 0.003;
  const std::vector<Pose> path = ColorPoses(frames, map);
  BoundImages(29, map);
  BoundKeyframes(29, path, frames, map);
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

TEST(KeyframeBudget, KeepsTheFirstKeyframeAfterTrackingWasLost) {
  TrackingMap map = Way(30);
  map.landmarks.resize(1);
  std::vector<TrackedFrame> frames = FramesOf(map);
  map.keyframes[5].previous = frames[10].previous_keyframe = 2;
  map.keyframes[5].T_previous_color = frames[10].T_previous_color =
      map.keyframes[2].T_world_color.inverse() * map.keyframes[5].T_world_color;
  const std::vector<Pose> path = ColorPoses(frames, map);
  BoundImages(29, map);
  BoundKeyframes(29, path, frames, map);
  EXPECT_EQ(map.keyframes.size(), 30U);
  EXPECT_EQ(frames[10].keyframe, 5);
}

TEST(KeyframeBudget, GivesUpNoneThatHasImages) {
  TrackingMap map = Way(40);
  map.landmarks.resize(1);
  std::vector<TrackedFrame> frames = FramesOf(map);
  BoundImages(30, map);
  BoundKeyframes(20, ColorPoses(frames, map), frames, map);
  EXPECT_EQ(map.keyframes.size(), 30U);
  EXPECT_EQ(WithImages(map).size(), 30U);
}

}  // namespace
}  // namespace plumb
