// SPDX-License-Identifier: Apache-2.0
// The driver "realsense", from its name in a configuration to a stored scan: the library's file
// holds a fake one, whose camera shows a sweep of a simulated stereo unit.
#include <chrono>
#include <filesystem>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "daemon/config/sensor_settings.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "tests/devices/realsense/fake_realsense.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/plumbd/stored_scan.hpp"

namespace plumb {
namespace {

namespace fake = fake_realsense;
using namespace std::chrono_literals;

constexpr int kFrames = 48;
constexpr int kWidth = 640, kHeight = 480;
constexpr std::int64_t kPeriod_us = 125'000;  // Slower than the sweep was, for busy machines.
constexpr const char* kSerial = "728612070259";

struct SweepImages {
  SweepImages() {
    const auto source = testing::DemoSweep(kFrames);
    info = source->info();
    while (const std::optional<Frame> frame = source->Next()) {
      cv::Mat color, depth_m, depth;
      cv::resize(frame->color_rgb, color, {kWidth, kHeight}, 0, 0, cv::INTER_CUBIC);
      cv::resize(frame->depth_m, depth_m, {kWidth, kHeight}, 0, 0, cv::INTER_NEAREST);
      depth_m.convertTo(depth, CV_16U, 4000.0);
      pairs.emplace_back(color, depth);
    }
    info.intrinsics = Resized(info.intrinsics, kWidth, kHeight);
  }
  StreamInfo info;
  std::vector<std::pair<cv::Mat, cv::Mat>> pairs;
};

fake::FakeUnit UnitOf(const StreamInfo& info) {
  realsense::RsIntrinsics camera{.width = kWidth,
                                 .height = kHeight,
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

/// Plays the sweep back and forth while the camera streams.
void Play(const SweepImages& sweep, const std::stop_token& stop) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < sweep.pairs.size(); ++i) order.push_back(i);
  for (std::size_t i = sweep.pairs.size() - 2; i > 0; --i) order.push_back(i);
  const auto start = std::chrono::steady_clock::now();
  for (std::int64_t n = 0; !stop.stop_requested(); ++n) {
    std::this_thread::sleep_until(start + n * std::chrono::microseconds(kPeriod_us));
    const auto& [color, depth] = sweep.pairs[order[static_cast<std::size_t>(n) % order.size()]];
    const auto deliver = [&](int stream, int format, const cv::Mat& image) {
      (void)fake::Deliver(
          kSerial,
          {.stream = stream,
           .format = format,
           .width = kWidth,
           .height = kHeight,
           .stride = static_cast<int>(image.step),
           .data = image.data,
           .number = static_cast<std::uint64_t>(n),
           .metadata = {{realsense::kMetadataSensorTimestamp, 4'294'000'000 + n * kPeriod_us}}});
    };
    deliver(realsense::kStreamColor, realsense::kFormatRgb8, color);
    deliver(realsense::kStreamDepth, realsense::kFormatZ16, depth);
  }
}

TEST(RealSenseDriverTest, AScanWithItIsStored) {
  EventLoop loop;  // first: blocks signals before any thread starts
  const testing::TempFolder folder;
  const SweepImages sweep;
  const RoomMarkers& markers = sweep.info.room_markers;
  Config config = ParseConfig(
      fmt::format("[sensor]\ndriver = \"realsense\"\nlibrary = \"{}\"\nexposure_us = 8000\n"
                  "[markers]\ndictionary = \"{}\"\nlength_m = {}\nreference = {}\n",
                  PLUMB_FAKE_REALSENSE, markers.dictionary, markers.length_m,
                  markers.reference.value()),
      "plumb.toml");
  config.appliance.state = folder / "state";
  fake::Reset();
  fake::Attach(UnitOf(sweep.info));
  const std::jthread camera([&](const std::stop_token& stop) { Play(sweep, stop); });
  const std::unique_ptr<SensorSetup> setup = BuiltInSensors()
                                                 .Choose(config.appliance.sensor_driver, false)
                                                 .set_up(SensorSettingsOf(config), {}, {}, {});
  // The whole way there and back: only one end of the sweep may show the reference marker.
  const testing::StoredScan stored = testing::ScanWith(loop, *setup, config, 2 * kFrames - 2);
  EXPECT_EQ(stored.status["sensor"]["serial"], kSerial) << stored.status.dump(2);
  ASSERT_EQ(stored.status["last_result"]["is_reference"], true);
  EXPECT_TRUE(std::filesystem::exists(stored.folder / "scene" / "scene.json"));
  EXPECT_EQ(fake::OptionOf(kSerial, realsense::kStreamColor, realsense::kOptionExposure), 80.0F)
      << "in units of 100 us";
  const auto recording = OpenTumRecording(stored.folder / "recording");
  EXPECT_EQ(recording->info().depth_sensor, DepthSensor::kActiveStereo);
  EXPECT_NEAR(recording->info().intrinsics.fx, sweep.info.intrinsics.fx, 1e-3);
  EXPECT_GE(recording->info().num_frames, kFrames / 2);
  EXPECT_EQ(fake::NumAlive(), 0) << "what the library gives out is given back";
}

}  // namespace
}  // namespace plumb
