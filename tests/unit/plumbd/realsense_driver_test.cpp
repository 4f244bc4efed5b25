// SPDX-License-Identifier: Apache-2.0
// The driver "realsense", from its name in a configuration to a stored scan: the library's file
// holds a fake one, whose camera shows a sweep of a simulated stereo unit.
#include <filesystem>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/config/sensor_settings.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "tests/devices/realsense/fake_realsense.hpp"
#include "tests/support/temp_folder.hpp"
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
  const testing::TempFolder folder;
  const testing::PlayedSweep sweep(4000.0);
  Config config = testing::ConfigForDriver("realsense", PLUMB_FAKE_REALSENSE,
                                           sweep.info.room_markers, "exposure_us = 8000\n");
  config.appliance.state = folder / "state";
  fake::Reset();
  fake::Attach(UnitOf(sweep.info));
  const std::jthread camera([&](const std::stop_token& stop) { sweep.Play(stop, DeliverPair); });
  const std::unique_ptr<SensorSetup> setup = BuiltInSensors()
                                                 .Choose(config.appliance.sensor_driver, false)
                                                 .set_up(SensorSettingsOf(config), {}, {}, {});
  const testing::StoredScan stored =
      testing::ScanWith(loop, *setup, config, testing::kPlayedWholeWay);
  EXPECT_EQ(stored.status["sensor"]["serial"], kSerial) << stored.status.dump(2);
  ASSERT_EQ(stored.status["last_result"]["is_reference"], true);
  EXPECT_TRUE(std::filesystem::exists(stored.folder / "scene" / "scene.json"));
  EXPECT_EQ(fake::OptionOf(kSerial, realsense::kStreamColor, realsense::kOptionExposure), 80.0F)
      << "in units of 100 us";
  const auto recording = OpenTumRecording(stored.folder / "recording");
  EXPECT_EQ(recording->info().depth_sensor, DepthSensor::kActiveStereo);
  EXPECT_NEAR(recording->info().intrinsics.fx, sweep.info.intrinsics.fx, 1e-3);
  EXPECT_GE(recording->info().num_frames, testing::kPlayedFrames / 2);
  EXPECT_EQ(fake::NumAlive(), 0) << "what the library gives out is given back";
}

}  // namespace
}  // namespace plumb
