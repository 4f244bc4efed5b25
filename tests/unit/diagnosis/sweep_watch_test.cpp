// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/sweep_watch.hpp"

#include <algorithm>
#include <cstdint>

#include <gtest/gtest.h>

namespace plumb {
namespace {

Frame FrameAt(int index, double depth_m) {
  Frame frame;
  frame.index = index;
  frame.color_time_s = frame.depth_time_s = index / 15.0;
  frame.color_rgb = cv::Mat(480, 640, CV_8UC3, cv::Scalar::all(index % 256));
  frame.depth_m = cv::Mat(480, 640, CV_32FC1, cv::Scalar(depth_m + 1e-4 * index));
  return frame;
}

// As the reconstructor does.
void Show(const Frame& frame, SweepWatch& watch) {
  if (!watch.IsRepetition(frame)) watch.Add(frame, true);
}

TEST(SweepWatchTest, CountsRepeatedImagesAndDepthOutOfRange) {
  SweepWatch watch({0.3, 4.0});
  for (int i = 0; i < 8; ++i) Show(FrameAt(i, i < 2 ? 0.2 : i < 3 ? 5.0 : 1.0), watch);
  Frame again = FrameAt(8, 1.0);
  Show(again, watch);
  again.color_time_s += 0.03;
  Show(again, watch);
  Frame empty = FrameAt(9, 1.0);
  empty.depth_m.setTo(0);
  Show(empty, watch);
  empty.color_rgb = empty.color_rgb + cv::Scalar::all(1);
  Show(empty, watch);
  const Symptoms symptoms = watch.Finish({}, true);
  EXPECT_EQ(symptoms.num_frames, 12);
  EXPECT_EQ(symptoms.num_repeated_depth, 1) << "empty images are no repetition";
  EXPECT_EQ(symptoms.num_repeated_color, 1);
  EXPECT_DOUBLE_EQ(symptoms.share_near, 2.0 / 9);
  EXPECT_DOUBLE_EQ(symptoms.share_far, 1.0 / 9);
  EXPECT_FALSE(symptoms.foreign_markers);
  EXPECT_FALSE(symptoms.stream_offset);
}

TEST(SweepWatchTest, APlayerThatWaitsRepeatsNothing) {
  SweepWatch watch({0.3, 4.0});
  for (int i = 0; i < 40; ++i) Show(FrameAt(std::max(0, i - 20), 1.0), watch);
  EXPECT_EQ(watch.Finish({}, true).num_repeated_depth, 0);
  EXPECT_EQ(watch.Finish({}, true).num_repeated_color, 0);
  EXPECT_EQ(watch.Finish({}, true).num_frames, 40);
  SweepWatch doubled({0.3, 4.0});
  for (int i = 0; i < 40; ++i) Show(FrameAt(i / 2, 1.0), doubled);
  EXPECT_EQ(doubled.Finish({}, true).num_repeated_depth, 19);
}

TEST(SweepWatchTest, AnImageOfBeforeWithANewStampIsARepetition) {
  SweepWatch watch({0.3, 4.0});
  EXPECT_FALSE(watch.IsRepetition(FrameAt(0, 1.0)));
  EXPECT_FALSE(watch.IsRepetition(FrameAt(1, 1.0)));
  Frame old_depth = FrameAt(2, 1.0);
  old_depth.depth_m = FrameAt(1, 1.0).depth_m;
  EXPECT_TRUE(watch.IsRepetition(old_depth));
  Frame old_color = FrameAt(3, 1.0);
  old_color.color_rgb = old_depth.color_rgb;
  EXPECT_TRUE(watch.IsRepetition(old_color));
  EXPECT_FALSE(watch.IsRepetition(FrameAt(4, 1.0)));
}

TEST(SweepWatchTest, MeasuresBrightnessAndItsChanges) {
  SweepWatch watch({0.3, 4.0});
  for (int i = 0; i < 20; ++i) {
    Frame frame = FrameAt(i, 1.0);
    frame.color_rgb = cv::Mat(480, 640, CV_8UC3, cv::Scalar::all(i < 5 ? 255 : i % 2 ? 20 : 24));
    frame.color_rgb.at<cv::Vec3b>(0, 0)[0] = static_cast<std::uint8_t>(i);  // No two are equal.
    Show(frame, watch);
  }
  const Symptoms symptoms = watch.Finish({}, true);
  EXPECT_DOUBLE_EQ(symptoms.median_gray, 24);
  EXPECT_DOUBLE_EQ(symptoms.share_white, 5.0 / 20);
  EXPECT_DOUBLE_EQ(symptoms.share_flickers, 15.0 / 20);
}

}  // namespace
}  // namespace plumb
