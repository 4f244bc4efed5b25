// SPDX-License-Identifier: Apache-2.0
// A sweep of the simulator, which a fake library's camera plays.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "daemon/config/sensor_settings.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/plumbd/stored_scan.hpp"

namespace plumb::testing {

inline constexpr int kPlayedFrames = 48;
inline constexpr int kPlayedWidth = 640, kPlayedHeight = 480;
/// Slower than the sweep was, for busy machines.
inline constexpr std::int64_t kPlayedPeriod_us = 125'000;
/// The whole way there and back: only one end of the sweep may show the reference marker.
inline constexpr int kPlayedWholeWay = 2 * kPlayedFrames - 2;

struct PlayedSweep {
  /// @param units_per_metre  Of the depth images.
  explicit PlayedSweep(double units_per_metre) {
    const auto source = DemoSweep(kPlayedFrames);
    info = source->info();
    while (const std::optional<Frame> frame = source->Next()) {
      cv::Mat color, depth_m, depth;
      cv::resize(frame->color_rgb, color, {kPlayedWidth, kPlayedHeight}, 0, 0, cv::INTER_CUBIC);
      cv::resize(frame->depth_m, depth_m, {kPlayedWidth, kPlayedHeight}, 0, 0, cv::INTER_NEAREST);
      depth_m.convertTo(depth, CV_16U, units_per_metre);
      pairs.emplace_back(color, depth);
    }
    info.intrinsics = Resized(info.intrinsics, kPlayedWidth, kPlayedHeight);
  }

  /// Plays it back and forth in real time. The images come with their number.
  void Play(const std::stop_token& stop,
            const std::function<void(const cv::Mat& color, const cv::Mat& depth, std::int64_t n)>&
                deliver) const {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < pairs.size(); ++i) order.push_back(i);
    for (std::size_t i = pairs.size() - 2; i > 0; --i) order.push_back(i);
    const auto start = std::chrono::steady_clock::now();
    for (std::int64_t n = 0; !stop.stop_requested(); ++n) {
      std::this_thread::sleep_until(start + n * std::chrono::microseconds(kPlayedPeriod_us));
      const auto& [color, depth] = pairs[order[static_cast<std::size_t>(n) % order.size()]];
      deliver(color, depth, n);
    }
  }

  StreamInfo info;
  std::vector<std::pair<cv::Mat, cv::Mat>> pairs;
};

/// As far as the drivers of makers' libraries share it. @param more  Further keys of [sensor].
inline Config ConfigForDriver(const std::string& driver, const std::string& library,
                              const RoomMarkers& markers, const std::string& more = "") {
  return ParseConfig(fmt::format("[sensor]\ndriver = \"{}\"\nlibrary = \"{}\"\n{}"
                                 "[markers]\ndictionary = \"{}\"\nlength_m = {}\nreference = {}\n",
                                 driver, library, more, markers.dictionary, markers.length_m,
                                 markers.reference.value()),
                     "plumb.toml");
}

/// A scan with the driver, from its name in a configuration to what is stored, while a camera plays
/// the sweep. @param more  Further keys of [sensor]. @return the recording.
template <typename Deliver>
std::unique_ptr<FrameSource> ExpectStoredScan(EventLoop& loop, const std::string& driver,
                                              const std::string& library, const PlayedSweep& sweep,
                                              const std::string& serial, Deliver&& deliver,
                                              const std::string& more = "") {
  static const TempFolder folder;
  Config config = ConfigForDriver(driver, library, sweep.info.room_markers, more);
  config.appliance.state = folder / driver;
  const std::jthread camera([&](const std::stop_token& stop) { sweep.Play(stop, deliver); });
  const std::unique_ptr<SensorSetup> setup = BuiltInSensors()
                                                 .Choose(config.appliance.sensor_driver, false)
                                                 .set_up(SensorSettingsOf(config), {}, {}, {});
  const StoredScan stored = ScanWith(loop, *setup, config, kPlayedWholeWay);
  EXPECT_EQ(stored.status["sensor"]["serial"], serial) << stored.status.dump(2);
  EXPECT_EQ(stored.status["last_result"]["is_reference"], true);
  EXPECT_TRUE(std::filesystem::exists(stored.folder / "scene" / "scene.json"));
  auto recording = OpenTumRecording(stored.folder / "recording");
  EXPECT_GE(recording->info().num_frames, kPlayedFrames / 2);
  return recording;
}

}  // namespace plumb::testing
