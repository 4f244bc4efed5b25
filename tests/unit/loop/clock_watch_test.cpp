// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/clock_watch.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

using std::chrono::hours;
using std::chrono::minutes;
using std::chrono::seconds;

class ClockWatchTest : public ::testing::Test {
 protected:
  void Pass(seconds time) {
    wall_ += time;
    steady_ += time;
    watch_.Look(wall_, steady_);
  }
  ClockWatch::Wall wall_{hours(400'000)};
  ClockWatch::Steady steady_{seconds(10)};
  ClockWatch watch_{wall_, steady_};
};

TEST_F(ClockWatchTest, HoldsWhileItGoesOnAsTimeDoes) {
  EXPECT_EQ(watch_.held(), seconds(0));
  for (int i = 0; i < 180; ++i) Pass(minutes(1));
  EXPECT_EQ(watch_.held(), hours(3));
  wall_ += seconds(2);  // disciplined
  Pass(seconds(1));
  EXPECT_GT(watch_.held(), hours(3));
}

TEST_F(ClockWatchTest, IsNotTrustedAfterAStepEitherWay) {
  for (const hours step : {hours(24 * 365), hours(-24)}) {
    Pass(hours(2));
    EXPECT_GE(watch_.held(), hours(2));
    wall_ += step;
    Pass(seconds(1));
    EXPECT_EQ(watch_.held(), seconds(0));
  }
  Pass(minutes(5));
  EXPECT_EQ(watch_.held(), minutes(5));
}

TEST_F(ClockWatchTest, TellsAStepAndItsDirection) {
  EXPECT_EQ(watch_.Look(wall_, steady_), minutes(0));
  EXPECT_EQ(watch_.Look(wall_ + seconds(2), steady_), minutes(0));
  EXPECT_EQ(watch_.Look(wall_ + hours(24), steady_), hours(24));
  EXPECT_EQ(watch_.Look(wall_, steady_), hours(-24));
}

}  // namespace
}  // namespace plumb
