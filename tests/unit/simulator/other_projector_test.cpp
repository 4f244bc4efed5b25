// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/other_projector.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

namespace plumb::simulated {
namespace {

constexpr int kColumns = 320, kRows = 240;
constexpr float kDepth_m = 1.1F;

cv::Mat Disturbed(const OtherProjector& projector, double time_s) {
  cv::Mat depth_m(kRows, kColumns, CV_32F, cv::Scalar(kDepth_m));
  projector.Disturb(time_s, depth_m);
  return depth_m;
}

struct Shares {
  double lost = 0, wrong = 0, farthest_m = 0;
};
Shares SharesOf(const cv::Mat& depth_m) {
  Shares shares;
  for (int row = 0; row < depth_m.rows; ++row) {
    for (int column = 0; column < depth_m.cols; ++column) {
      const float depth = depth_m.at<float>(row, column);
      const double off_m = std::abs(depth - kDepth_m);
      if (depth == 0)
        ++shares.lost;
      else if (off_m > 1e-4)
        ++shares.wrong;
      if (depth > 0) shares.farthest_m = std::max(shares.farthest_m, off_m);
    }
  }
  shares.lost /= depth_m.total();
  shares.wrong /= depth_m.total();
  return shares;
}

TEST(OtherProjectorTest, TakesAShareOfThePixelsAndFalsifiesAnother) {
  const OtherProjector projector(7, kColumns, kRows);
  Shares all;
  constexpr int kTimes = 20;  // over the seconds of a beat and more
  for (int i = 0; i < kTimes; ++i) {
    const Shares now = SharesOf(Disturbed(projector, 0.1 * i));
    all.lost += now.lost / kTimes;
    all.wrong += now.wrong / kTimes;
    all.farthest_m = std::max(all.farthest_m, now.farthest_m);
  }
  EXPECT_NEAR(all.lost, 0.15, 0.04);
  // 27 % are wrong, most of the time by more than 0.1 mm.
  EXPECT_NEAR(all.wrong, 0.24, 0.04);
  EXPECT_LE(all.farthest_m, 0.0031);
  EXPECT_GT(all.farthest_m, 0.0025);
}

TEST(OtherProjectorTest, ErrorsComeAndGoAtTheSamePlaces) {
  const OtherProjector projector(7, kColumns, kRows);
  const cv::Mat most = Disturbed(projector, 0.25 / 0.7), least = Disturbed(projector, 0.75 / 0.7);
  EXPECT_GT(SharesOf(most).wrong, 4 * SharesOf(least).wrong);
  EXPECT_EQ(cv::countNonZero(Disturbed(projector, 0.3) !=
                             Disturbed(OtherProjector(7, kColumns, kRows), 0.3)),
            0);
  EXPECT_GT(cv::countNonZero(Disturbed(projector, 0.3) !=
                             Disturbed(OtherProjector(8, kColumns, kRows), 0.3)),
            0);
  cv::Mat none = cv::Mat::zeros(kRows, kColumns, CV_32F);
  projector.Disturb(0.3, none);
  EXPECT_EQ(cv::countNonZero(none), 0) << "what was not measured stays so";
}

}  // namespace
}  // namespace plumb::simulated
