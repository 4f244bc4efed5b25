// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/stream_offset.hpp"

#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace plumb {
namespace {

// Where a camera that is swept by hand looks, pixels.
cv::Point2d Place(double time_s, bool steady = false) {
  if (steady) return {40.0 * time_s, 0.0};
  return {90 * std::sin(1.7 * time_s) + 25 * std::sin(5.1 * time_s),
          60 * std::cos(2.3 * time_s) + 12 * std::sin(6.3 * time_s)};
}

// A window of a large texture.
cv::Mat Window(const cv::Mat& texture, const cv::Point2d& place) {
  cv::Mat window;
  cv::getRectSubPix(texture, {640, 480}, cv::Point2f(700 + place.x, 600 + place.y), window);
  return window;
}

struct Sweep {
  ImageMotion color, depth;
};

// 100 images a second / rate; depth is taken `offset_s` before it is stamped.
Sweep MakeSweep(double offset_s, bool steady = false, int num_frames = 100) {
  cv::RNG random(3);
  cv::Mat texture(1300, 1500, CV_32FC1), relief(1300, 1500, CV_32FC1);
  random.fill(texture, cv::RNG::UNIFORM, 0, 1);
  random.fill(relief, cv::RNG::UNIFORM, 0, 1);
  cv::GaussianBlur(texture, texture, {}, 12);
  cv::GaussianBlur(relief, relief, {}, 25);
  cv::normalize(texture, texture, 0, 255, cv::NORM_MINMAX);
  cv::normalize(relief, relief, 0.7, 1.3, cv::NORM_MINMAX);
  Sweep sweep;
  for (int i = 0; i < num_frames; ++i) {
    const double time_s = i / 15.0;
    cv::Mat color;
    Window(texture, Place(time_s, steady)).convertTo(color, CV_8U);
    sweep.color.AddColor(color, time_s);
    sweep.depth.AddDepth(Window(relief, Place(time_s - offset_s, steady)), time_s);
  }
  return sweep;
}

TEST(StreamOffsetTest, IsWhatTheMotionOfBothShows) {
  for (const double offset_s : {0.0, 0.015, 0.033, 0.2, -0.05, -0.2}) {
    const Sweep sweep = MakeSweep(offset_s);
    const auto found = EstimateStreamOffset(sweep.color.rates(), sweep.depth.rates());
    ASSERT_TRUE(found) << offset_s;
    EXPECT_NEAR(found->offset_s, offset_s, 0.006);
    EXPECT_LT(found->sigma_s, 0.01);
  }
}

TEST(StreamOffsetTest, ASteadyOrShortSweepShowsNone) {
  const Sweep steady = MakeSweep(0.1, true);
  EXPECT_FALSE(EstimateStreamOffset(steady.color.rates(), steady.depth.rates()));
  const Sweep brief = MakeSweep(0.1, false, 25);
  EXPECT_FALSE(EstimateStreamOffset(brief.color.rates(), brief.depth.rates()));
  EXPECT_FALSE(EstimateStreamOffset({}, {}));
}

// At the last offsets that are tried there is no room for a parabola about the peak.
TEST(StreamOffsetTest, AnOffsetAtTheEdgeOfWhatIsTriedIsNone) {
  // Shaken, so that the peak is sharp, and 200 images a second.
  const auto rates = [](double offset_s) {
    std::vector<ImageMotion::Rate> made;
    for (int i = 0; i < 1200; ++i) {
      const double time_s = 0.005 * i - offset_s;
      Eigen::Vector2d px_per_s = Eigen::Vector2d::Zero();
      for (const double rate : {3.1, 7.3, 12.9, 21.7, 33.1, 47.9, 61.3})
        px_per_s += Eigen::Vector2d(std::cos(rate * time_s), std::sin(rate * time_s + rate));
      made.push_back({0.005 * i, px_per_s});
    }
    return made;
  };
  for (const double side : {-1.0, 1.0}) {
    EXPECT_TRUE(EstimateStreamOffset(rates(0), rates(side * 0.590)));
    EXPECT_FALSE(EstimateStreamOffset(rates(0), rates(side * 0.595)));
    EXPECT_FALSE(EstimateStreamOffset(rates(0), rates(side * 0.600)));
  }
}

TEST(StreamOffsetTest, TheSpeedIsInWidthsOfTheImage) {
  cv::Mat wall(72, 200, CV_8UC3);
  cv::RNG random(3);
  random.fill(wall, cv::RNG::UNIFORM, 0, 255);
  ImageMotion motion;
  EXPECT_EQ(motion.MedianWidthsPerSecond(), 0.0);
  for (int i = 0; i < 20; ++i) motion.AddColor(wall(cv::Rect(3 * i, 0, 96, 72)).clone(), 0.1 * i);
  EXPECT_NEAR(motion.MedianWidthsPerSecond(), 30.0 / 96, 0.01);
}

}  // namespace
}  // namespace plumb
