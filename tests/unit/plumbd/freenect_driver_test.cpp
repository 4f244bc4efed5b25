// SPDX-License-Identifier: Apache-2.0
// The driver "freenect", from its name in a configuration to a stored scan: the library's file
// holds a fake one, whose Kinect shows a sweep of a simulated unit.
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>

#include "daemon/config/sensor_settings.hpp"
#include "drivers/freenect/freenect_api.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "tests/devices/freenect/fake_freenect.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/plumbd/played_sweep.hpp"

namespace plumb {
namespace {

namespace fake = fake_freenect;

TEST(FreenectDriverTest, AScanWithItIsStored) {
  EventLoop loop;  // first: blocks signals before any thread starts
  const testing::TempFolder folder;
  const testing::PlayedSweep sweep(1000.0);
  const std::string serial = fake::FakeKinect().serial;
  Config config =
      testing::ConfigForDriver("freenect", PLUMB_FAKE_FREENECT, sweep.info.room_markers);
  config.appliance.state = folder / "state";
  fake::Reset();
  fake::Attach({});
  const std::jthread kinect([&](const std::stop_token& stop) {
    sweep.Play(stop, [&](const cv::Mat& color, const cv::Mat& depth, std::int64_t n) {
      // Of 60 MHz, and soon at the end of its 32 bits.
      const auto stamp =
          static_cast<std::uint32_t>(4'200'000'000 + 60 * n * testing::kPlayedPeriod_us);
      (void)fake::Deliver(serial, false, color.data, stamp);
      (void)fake::Deliver(serial, true, depth.data, stamp);
    });
  });
  const std::unique_ptr<SensorSetup> setup = BuiltInSensors()
                                                 .Choose(config.appliance.sensor_driver, false)
                                                 .set_up(SensorSettingsOf(config), {}, {}, {});
  const testing::StoredScan stored =
      testing::ScanWith(loop, *setup, config, testing::kPlayedWholeWay);
  EXPECT_EQ(stored.status["sensor"]["serial"], serial) << stored.status.dump(2);
  ASSERT_EQ(stored.status["last_result"]["is_reference"], true);
  EXPECT_TRUE(std::filesystem::exists(stored.folder / "scene" / "scene.json"));
  EXPECT_EQ(fake::FlagOf(serial, freenect::kAutoExposure), 1) << "held in the scan, free after it";
  const auto recording = OpenTumRecording(stored.folder / "recording");
  EXPECT_EQ(recording->info().depth_sensor, DepthSensor::kStructuredLight);
  EXPECT_GE(recording->info().num_frames, testing::kPlayedFrames / 2);
  EXPECT_EQ(fake::NumAlive(), 0) << "what the library gives out is given back";
}

}  // namespace
}  // namespace plumb
