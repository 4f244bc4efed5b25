// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/sweep_watch.hpp"

#include <algorithm>

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

TEST(SweepWatchTest, CountsRepeatedImagesAndDepthOutOfRange) {
  SweepWatch watch({0.3, 4.0});
  for (int i = 0; i < 8; ++i) watch.Add(FrameAt(i, i < 2 ? 0.2 : i < 3 ? 5.0 : 1.0), true);
  Frame again = FrameAt(8, 1.0);
  watch.Add(again, true);
  again.color_time_s += 0.03;
  watch.Add(again, true);
  Frame empty = FrameAt(9, 1.0);
  empty.depth_m.setTo(0);
  watch.Add(empty, true);
  empty.color_rgb = empty.color_rgb + cv::Scalar::all(1);
  watch.Add(empty, true);
  const Symptoms symptoms = watch.Finish({}, true);
  EXPECT_EQ(symptoms.num_frames, 12);
  EXPECT_EQ(symptoms.num_repeated_depth, 1) << "empty images are no repetition";
  EXPECT_EQ(symptoms.num_repeated_color, 1);
  EXPECT_DOUBLE_EQ(symptoms.share_near, 0.2);
  EXPECT_DOUBLE_EQ(symptoms.share_far, 0.1);
  EXPECT_FALSE(symptoms.foreign_markers);
  EXPECT_FALSE(symptoms.stream_offset);
}

TEST(SweepWatchTest, APlayerThatWaitsRepeatsNothing) {
  SweepWatch watch({0.3, 4.0});
  for (int i = 0; i < 40; ++i) watch.Add(FrameAt(std::max(0, i - 20), 1.0), true);
  EXPECT_EQ(watch.Finish({}, true).num_repeated_depth, 1);
  EXPECT_EQ(watch.Finish({}, true).num_repeated_color, 1);
  SweepWatch doubled({0.3, 4.0});
  for (int i = 0; i < 40; ++i) doubled.Add(FrameAt(i / 2, 1.0), true);
  EXPECT_EQ(doubled.Finish({}, true).num_repeated_depth, 20);
}

}  // namespace
}  // namespace plumb
