// SPDX-License-Identifier: Apache-2.0
// The examples of drivers/stream, from the driver's name in a configuration to a stored scan.
#include <filesystem>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/config/sensor_settings.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "tests/support/process.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/plumbd/stored_scan.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kFrames = 60;
constexpr double kRate_hz = 12.0;  // Slower than the sweep was, for busy machines.

/// A sweep of the simulator's demo as raw images, and the first message for them.
RoomMarkers WriteSweep(const fs::path& folder) {
  const auto source = testing::DemoSweep(kFrames);
  const Intrinsics camera = source->info().intrinsics;
  const std::array<double, 9> matrix = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  // Depth in its own unit, by a camera of its own, which happens to be where colour's is.
  const json hello = {{"protocol", "plumb stream"},
                      {"version", 1},
                      {"name", "the example's camera"},
                      {"serial", "FEED-7"},
                      {"rate_hz", kRate_hz},
                      {"camera",
                       {{"image_width", camera.width},
                        {"image_height", camera.height},
                        {"camera_matrix", matrix},
                        {"distortion_coefficients", camera.distortion},
                        {"depth_scale", 4000},
                        {"depth_registered", 0},
                        {"depth_camera_matrix", matrix},
                        {"depth_distortion_coefficients", camera.distortion},
                        {"T_color_depth", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}},
                        {"depth_noise",
                         {{"constant_m", 0.0005},
                          {"linear_m_per_m", 0},
                          {"quadratic_m_per_m2", 0.004},
                          {"origin_m", 0},
                          {"grazing_m", 0}}}}}};
  fs::create_directories(folder);
  WriteWholeFile(folder / "hello.json", hello.dump());
  while (const std::optional<Frame> frame = source->Next()) {
    cv::Mat units;
    frame->depth_m.convertTo(units, CV_16U, 4000.0);
    const auto write = [&](const char* ending, const cv::Mat& image) {
      WriteWholeFile(folder / fmt::format("{:04}.{}", frame->index, ending),
                     std::span(image.data, image.total() * image.elemSize()));
    };
    write("color", frame->color_rgb);
    write("depth", units);
  }
  return source->info().room_markers;
}

class StreamExampleTest : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Languages, StreamExampleTest, ::testing::Values("Python", "Cpp"),
                         [](const auto& language) { return std::string(language.param); });

TEST_P(StreamExampleTest, AScanWithItIsStored) {
  EventLoop loop;  // first: blocks signals before any thread starts
  const testing::TempFolder folder;
  const RoomMarkers markers = WriteSweep(folder / "sweep");
  const fs::path socket = folder / "sensor.sock";
  Config config = ParseConfig(
      fmt::format("[sensor]\ndriver = \"stream\"\nsocket = \"{}\"\n"
                  "[markers]\ndictionary = \"{}\"\nlength_m = {}\nreference = {}\n",
                  socket.string(), markers.dictionary, markers.length_m, markers.reference.value()),
      "plumb.toml");
  config.appliance.state = folder / "state";
  const std::unique_ptr<SensorSetup> setup = BuiltInSensors()
                                                 .Choose(config.appliance.sensor_driver, false)
                                                 .set_up(SensorSettingsOf(config), {}, {}, {});
  // Each example ends if nobody listens, as when the camera's program starts before plumbd.
  const std::string feeder =
      std::string(GetParam()) == "Cpp"
          ? fmt::format("exec {} \"$@\"", PLUMB_FEED_EXAMPLE)
          : fmt::format("exec python3 {}/drivers/stream/examples/feed.py \"$@\"", PLUMB_SOURCE_DIR);
  const Process example({"/bin/sh", "-c", "while ! test -S \"$1\"; do sleep 0.1; done; " + feeder,
                         "feeder", socket.string(), (folder / "sweep").string()});
  const testing::StoredScan stored = testing::ScanWith(loop, *setup, config, kFrames);
  EXPECT_EQ(stored.status["sensor"]["serial"], "FEED-7") << stored.status.dump(2);
  ASSERT_EQ(stored.status["last_result"]["is_reference"], true);
  EXPECT_TRUE(fs::exists(stored.folder / "scene" / "scene.json"));
  const auto recording = OpenTumRecording(stored.folder / "recording");
  EXPECT_EQ(recording->info().depth_noise.quadratic_m_per_m2, 0.004);
  EXPECT_GE(recording->info().num_frames, kFrames / 2);
}

}  // namespace
}  // namespace plumb
