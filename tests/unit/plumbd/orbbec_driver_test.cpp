// SPDX-License-Identifier: Apache-2.0
// The driver "orbbec", from its name in a configuration to a stored scan: the library's file holds
// a fake one, whose camera shows a sweep of a simulated unit.

#include <gtest/gtest.h>

#include "tests/devices/orbbec/fake_orbbec.hpp"
#include "tests/unit/plumbd/played_sweep.hpp"

namespace plumb {
namespace {

namespace fake = fake_orbbec;

fake::FakeCamera CameraOf(const StreamInfo& info) {
  const auto& d = info.intrinsics.distortion;
  fake::FakeMode mode{.format = orbbec::kFormatRgb,
                      .camera = {.fx = static_cast<float>(info.intrinsics.fx),
                                 .fy = static_cast<float>(info.intrinsics.fy),
                                 .cx = static_cast<float>(info.intrinsics.cx),
                                 .cy = static_cast<float>(info.intrinsics.cy),
                                 .width = testing::kPlayedWidth,
                                 .height = testing::kPlayedHeight},
                      .lens = {.k1 = static_cast<float>(d[0]),
                               .k2 = static_cast<float>(d[1]),
                               .k3 = static_cast<float>(d[4]),
                               .p1 = static_cast<float>(d[2]),
                               .p2 = static_cast<float>(d[3]),
                               .model = orbbec::kDistortionBrownConrady}};
  fake::FakeCamera camera;
  camera.color_modes = {mode};
  mode.format = orbbec::kFormatZ16;
  camera.depth_modes = {mode};
  return camera;
}

TEST(OrbbecDriverTest, AScanWithItIsStored) {
  EventLoop loop;  // first: blocks signals before any thread starts
  const testing::PlayedSweep sweep(10'000.0);
  const std::string serial = fake::FakeCamera().serial;
  fake::Reset();
  fake::Attach(CameraOf(sweep.info));
  const auto deliver = [&](const cv::Mat& color, const cv::Mat& depth, std::int64_t n) {
    for (const cv::Mat& image : {color, depth}) {
      const bool is_depth = image.type() == CV_16UC1;
      (void)fake::Deliver(
          serial,
          {.is_depth = is_depth,
           .format = is_depth ? orbbec::kFormatZ16 : orbbec::kFormatRgb,
           .width = static_cast<std::uint32_t>(image.cols),
           .height = static_cast<std::uint32_t>(image.rows),
           .bytes = static_cast<std::uint32_t>(image.total() * image.elemSize()),
           .data = image.data,
           .number = static_cast<std::uint64_t>(n),
           .stamp_us = static_cast<std::uint64_t>(1'000'000 + n * testing::kPlayedPeriod_us),
           .scale_mm = 0.1F});
    }
  };
  const auto recording = testing::ExpectStoredScan(loop, "orbbec", PLUMB_FAKE_ORBBEC, sweep, serial,
                                                   deliver, "exposure_us = 8000\n");
  EXPECT_EQ(fake::PropertyOf(serial, orbbec::kPropertyColorExposure), 80) << "of 100 us each";
  EXPECT_EQ(recording->info().depth_sensor, DepthSensor::kActiveStereo);
  EXPECT_NEAR(recording->info().intrinsics.fx, sweep.info.intrinsics.fx, 1e-3);
  EXPECT_EQ(fake::NumAlive(), 0) << "what the library gives out is given back";
}

}  // namespace
}  // namespace plumb
