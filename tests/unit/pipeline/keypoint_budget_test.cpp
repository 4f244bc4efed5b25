// SPDX-License-Identifier: Apache-2.0
// When live frames are tracked with fewer keypoints: the decision on both sides of each limit.
#include "daemon/pipeline/frame_thinning.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

constexpr double kFramePeriod_s = 1.0 / 30;

// LoadOf is what all frames need of the time, as they are tracked now.
TrackingLoad LoadOf(double load, double late_s, double since_change_s = 5.0) {
  return {.frame_period_s = kFramePeriod_s,
          .tracking_s = load * kFramePeriod_s,
          .late_s = late_s,
          .since_change_s = since_change_s};
}

TEST(NextFewerKeypoints, ReducesThemOnceTrackingIsLateAndCannotCatchUp) {
  EXPECT_FALSE(NextFewerKeypoints(false, 1, LoadOf(1.2, 0.099))) << "not late yet";
  EXPECT_TRUE(NextFewerKeypoints(false, 1, LoadOf(1.2, 0.100)));
  EXPECT_FALSE(NextFewerKeypoints(false, 1, LoadOf(0.84, 0.3))) << "catches up by itself";
  EXPECT_TRUE(NextFewerKeypoints(false, 1, LoadOf(0.86, 0.3)));
  EXPECT_FALSE(NextFewerKeypoints(false, 2, LoadOf(1.69, 0.3))) << "the same at every second frame";
  EXPECT_TRUE(NextFewerKeypoints(false, 2, LoadOf(1.71, 0.3)));
  EXPECT_TRUE(NextFewerKeypoints(false, 1, LoadOf(1.2, 0.2, 0.0))) << "at once";
}

TEST(NextFewerKeypoints, UsesAllAgainOnlyWhereThatStaysInTime) {
  EXPECT_FALSE(NextFewerKeypoints(true, 1, LoadOf(0.49, 0.0)));
  EXPECT_TRUE(NextFewerKeypoints(true, 1, LoadOf(0.51, 0.0)));
  EXPECT_FALSE(NextFewerKeypoints(true, 1, LoadOf(0.3, 0.070)));
  EXPECT_TRUE(NextFewerKeypoints(true, 1, LoadOf(0.3, 0.071))) << "not in time yet";
  EXPECT_TRUE(NextFewerKeypoints(true, 1, LoadOf(0.3, 0.0, 1.99)));
  EXPECT_FALSE(NextFewerKeypoints(true, 1, LoadOf(0.3, 0.0, 2.0)));
  EXPECT_TRUE(NextFewerKeypoints(true, 2, LoadOf(0.3, 0.0)))
      << "first all frames, then all keypoints";
}

TEST(NextFewerKeypoints, BetweenTheLimitsNothingChanges) {
  for (const bool fewer : {false, true})
    for (const double load : {0.52, 0.69, 0.84})
      EXPECT_EQ(NextFewerKeypoints(fewer, 1, LoadOf(load, 0.08)), fewer) << load;
}

TEST(NextFewerKeypoints, StaysWhileNothingIsKnown) {
  for (const bool fewer : {false, true}) {
    EXPECT_EQ(NextFewerKeypoints(fewer, 1, {.late_s = 9, .since_change_s = 9}), fewer);
    EXPECT_EQ(NextFewerKeypoints(
                  fewer, 1, {.frame_period_s = kFramePeriod_s, .late_s = 9, .since_change_s = 9}),
              fewer);
  }
}

}  // namespace
}  // namespace plumb
