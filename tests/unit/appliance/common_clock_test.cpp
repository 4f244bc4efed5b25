// SPDX-License-Identifier: Apache-2.0
#include "daemon/monitoring/common_clock.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(CommonClockTest, TheShortestWayOfAnImageSaysHowTheClocksDiffer) {
  CommonClock clock;
  // Its clock is 100 s behind; images take 10 to 40 ms, and the jitter is not seen in the stamps.
  double before_s = clock.SteadyStamp(1.0, 101.010);
  for (int i = 1; i < 300; ++i) {
    const double stamp_s = 1.0 + i / 30.0;
    const double now_s = clock.SteadyStamp(stamp_s, stamp_s + 100.010 + 0.001 * (i * 7 % 30));
    // Between two of the shortest ways, a second apart, it may run apart by 1e-4 of that.
    EXPECT_NEAR(now_s - before_s, 1 / 30.0, 1.1e-4);
    before_s = now_s;
  }
  EXPECT_NEAR(before_s, 1.0 + 299 / 30.0 + 100.010, 3e-4) << "it may run apart by 1e-4";
}

TEST(CommonClockTest, ASensorThatWasPluggedInAgainBeginsAnewAndNeverGoesBack) {
  CommonClock clock;
  EXPECT_DOUBLE_EQ(clock.SteadyStamp(50.0, 200.0), 200.0);
  EXPECT_DOUBLE_EQ(clock.SteadyStamp(1.0, 203.0), 203.0);
  EXPECT_NEAR(clock.SteadyStamp(1.1, 203.101), 203.1, 1e-3);
  CommonClock late;
  EXPECT_DOUBLE_EQ(late.SteadyStamp(1.0, 10.5), 10.5);
  EXPECT_DOUBLE_EQ(late.SteadyStamp(1.1, 10.1), 10.5) << "its true way was shorter by 0.5 s";
}

}  // namespace
}  // namespace plumb
