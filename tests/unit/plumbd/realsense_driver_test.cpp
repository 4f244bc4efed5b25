// SPDX-License-Identifier: Apache-2.0
// The driver "realsense", from its name in a configuration to a stored scan: the library's file
// holds a fake one, whose camera shows a sweep of a simulated stereo unit.

#include <gtest/gtest.h>

#include "tests/devices/realsense/fake_realsense.hpp"
#include "tests/unit/plumbd/played_sweep.hpp"

namespace plumb {
namespace {

namespace fake = fake_realsense;

constexpr const char* kSerial = "728612070259";

fake::FakeUnit UnitOf(const StreamInfo& info) {
  realsense::RsIntrinsics camera{.width = testing::kPlayedWidth,
                                 .height = testing::kPlayedHeight,
                                 .ppx = static_cast<float>(info.intrinsics.cx),
                                 .ppy = static_cast<float>(info.intrinsics.cy),
                                 .fx = static_cast<float>(info.intrinsics.fx),
                                 .fy = static_cast<float>(info.intrinsics.fy),
                                 .model = realsense::kDistortionBrownConrady};
  for (std::size_t i = 0; i < camera.coefficients.size(); ++i)
    camera.coefficients[i] = static_cast<float>(info.intrinsics.distortion[i]);
  fake::FakeUnit unit;
  unit.serial = kSerial;
  unit.depth_unit_m = 0.00025F;
  unit.depth_modes = {{realsense::kStreamDepth, realsense::kFormatZ16, 30, camera}};
  unit.color_modes = {{realsense::kStreamColor, realsense::kFormatRgb8, 30, camera}};
  return unit;
}

void DeliverPair(const cv::Mat& color, const cv::Mat& depth, std::int64_t n) {
  const auto deliver = [&](int stream, int format, const cv::Mat& image) {
    (void)fake::Deliver(kSerial, {.stream = stream,
                                  .format = format,
                                  .width = image.cols,
                                  .height = image.rows,
                                  .stride = static_cast<int>(image.step),
                                  .data = image.data,
                                  .number = static_cast<std::uint64_t>(n),
                                  .metadata = {{realsense::kMetadataSensorTimestamp,
                                                4'294'000'000 + n * testing::kPlayedPeriod_us}}});
  };
  deliver(realsense::kStreamColor, realsense::kFormatRgb8, color);
  deliver(realsense::kStreamDepth, realsense::kFormatZ16, depth);
}

TEST(RealSenseDriverTest, AScanWithItIsStored) {
  EventLoop loop;  // first: blocks signals before any thread starts
  const testing::PlayedSweep sweep(4000.0);
  fake::Reset();
  fake::Attach(UnitOf(sweep.info));
  const auto recording = testing::ExpectStoredScan(loop, "realsense", PLUMB_FAKE_REALSENSE, sweep,
                                                   kSerial, DeliverPair, "exposure_us = 8000\n");
  EXPECT_EQ(fake::OptionOf(kSerial, realsense::kStreamColor, realsense::kOptionExposure), 80.0F)
      << "in units of 100 us";
  EXPECT_EQ(recording->info().depth_sensor, DepthSensor::kActiveStereo);
  EXPECT_NEAR(recording->info().intrinsics.fx, sweep.info.intrinsics.fx, 1e-3);
  EXPECT_EQ(fake::NumAlive(), 0) << "what the library gives out is given back";
}

}  // namespace
}  // namespace plumb
