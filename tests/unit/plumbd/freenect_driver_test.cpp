// SPDX-License-Identifier: Apache-2.0
// The driver "freenect", from its name in a configuration to a stored scan: the library's file
// holds a fake one, whose Kinect shows a sweep of a simulated unit.

#include <gtest/gtest.h>

#include "drivers/freenect/freenect_api.hpp"
#include "tests/devices/freenect/fake_freenect.hpp"
#include "tests/unit/plumbd/played_sweep.hpp"

namespace plumb {
namespace {

namespace fake = fake_freenect;

TEST(FreenectDriverTest, AScanWithItIsStored) {
  EventLoop loop;  // first: blocks signals before any thread starts
  const testing::PlayedSweep sweep(1000.0);
  const std::string serial = fake::FakeKinect().serial;
  fake::Reset();
  fake::Attach({});
  const auto deliver = [&](const cv::Mat& color, const cv::Mat& depth, std::int64_t n) {
    // Of 60 MHz, and soon at the end of its 32 bits.
    const auto stamp =
        static_cast<std::uint32_t>(4'200'000'000 + 60 * n * testing::kPlayedPeriod_us);
    (void)fake::Deliver(serial, false, color.data, stamp);
    (void)fake::Deliver(serial, true, depth.data, stamp);
  };
  const auto recording =
      testing::ExpectStoredScan(loop, "freenect", PLUMB_FAKE_FREENECT, sweep, serial, deliver);
  EXPECT_EQ(fake::FlagOf(serial, freenect::kAutoExposure), 1) << "held in the scan, free after it";
  EXPECT_EQ(recording->info().depth_sensor, DepthSensor::kStructuredLight);
  EXPECT_EQ(fake::NumAlive(), 0) << "what the library gives out is given back";
}

}  // namespace
}  // namespace plumb
