// SPDX-License-Identifier: Apache-2.0
// The driver of real sensors against OpenNI2 itself and the virtual sensor behind it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <thread>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/openni/openni_provider.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/openni/virtual_rig.hpp"

namespace plumb {
namespace {

using testing::CommandedSensor;
using testing::Eventually;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::SmallVirtualSensor;
using testing::VirtualRig;

std::vector<Frame> Take(LiveSensor& sensor, int count) {
  std::vector<Frame> frames;
  while (std::ssize(frames) < count) frames.push_back(sensor.Next().value());
  return frames;
}

// OpenNI2 keeps only the newest image of a stream: a loaded machine may lose some, so frames are
// recognised, not counted.
TEST(OpenNiSensorTest, GivesTheSimulatorsSweepToTheBit) {
  VirtualRig rig;
  const auto sensor = rig.provider.Open("");
  // The truth is rendered here again, without any of the code under test.
  const VirtualSensorOptions options = SmallVirtualSensor();
  const auto source = simulated::MakeSource(simulated::PlanSuite(ScenesOf(options)), 0);
  std::vector<Frame> truth;
  while (auto frame = source->Next()) truth.push_back(std::move(*frame));
  EXPECT_EQ(sensor->info().intrinsics, source->info().intrinsics);
  EXPECT_EQ(sensor->info().room_markers.dictionary, source->info().room_markers.dictionary);
  EXPECT_FALSE(sensor->info().intrinsics_assumed);

  (void)Take(*sensor, 1);
  rig.sensor.Rewind();
  sensor->Flush();
  std::size_t seen = 0, last = 0;
  std::optional<double> begin_s;  // of the simulator's time, on the sensor's clock
  while (last + 1 < truth.size()) {
    const Frame frame = sensor->Next().value();
    const auto same = [&](const Frame& other) {
      return cv::norm(frame.color_rgb, other.color_rgb, cv::NORM_INF) == 0.0;
    };
    const auto found =
        std::find_if(truth.begin() + static_cast<std::ptrdiff_t>(last), truth.end(), same);
    ASSERT_NE(found, truth.end()) << "no such colour image, or out of order, after frame " << last;
    last = static_cast<std::size_t>(found - truth.begin());
    ++seen;
    if (!begin_s) begin_s = frame.color_time_s - found->color_time_s;
    EXPECT_NEAR(frame.color_time_s - found->color_time_s, *begin_s,
                3e-6);  // stamps count microseconds
    EXPECT_NEAR(frame.depth_time_s - found->depth_time_s, *begin_s, 3e-6);
    EXPECT_LE(cv::norm(frame.depth_m, found->depth_m, cv::NORM_INF),
              0.00051);  // depth is rounded to millimetres
  }
  EXPECT_GE(seen, truth.size() / 2);
}

TEST(OpenNiSensorTest, ListsTheUnitBySerialAndUsbId) {
  VirtualRig rig;
  const std::vector<SensorDescription> sensors = rig.provider.List();
  ASSERT_EQ(sensors.size(), 1U);
  EXPECT_EQ(sensors[0].serial, "VIRTUAL-0001");
  EXPECT_EQ(sensors[0].usb_vendor, 0x1d27);
  EXPECT_EQ(sensors[0].usb_product, 0x0601);
}

TEST(OpenNiSensorTest, ComesAndGoesAndHasAnotherUriAfterEachPlug) {
  VirtualSensorOptions options = SmallVirtualSensor();
  options.plugged = false;
  VirtualRig rig(options);
  std::atomic<int> changes{0};
  rig.provider.SetListener([&] { ++changes; });
  EXPECT_TRUE(rig.provider.List().empty());
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)rig.provider.Open(""); }),
              HasSubstr("no sensor is attached"));

  rig.sensor.Plug();
  ASSERT_TRUE(Eventually([&] { return changes > 0 && rig.provider.List().size() == 1; }));
  const std::string uri = rig.provider.List().front().uri;
  const int before = changes;
  rig.sensor.Unplug();
  ASSERT_TRUE(Eventually([&] { return changes > before && rig.provider.List().empty(); }));
  rig.sensor.Plug();
  ASSERT_TRUE(Eventually([&] { return rig.provider.List().size() == 1; }));
  EXPECT_NE(rig.provider.List().front().uri, uri);
  EXPECT_EQ(rig.provider.List().front().serial, "VIRTUAL-0001");
}

TEST(OpenNiSensorTest, UnplugWhileWaitingIsDeviceLostAndTheUnitCanBeOpenedAgain) {
  VirtualRig rig;
  for (int round = 0; round < 3; ++round) {
    auto sensor = rig.provider.Open("VIRTUAL-0001");
    (void)Take(*sensor, 3);
    std::future<void> unplug = std::async(std::launch::async, [&] { rig.sensor.Unplug(); });
    EXPECT_THAT(MessageOf<DeviceLost>([&] {
                  while (sensor->Next()) {
                  }
                }),
                HasSubstr("VIRTUAL-0001 was unplugged"));
    unplug.get();
    sensor.reset();
    rig.sensor.Plug();
    ASSERT_TRUE(Eventually([&] { return rig.provider.List().size() == 1; }));
  }
}

TEST(OpenNiSensorTest, OpensByTheSerialAmongTwo) {
  VirtualRig rig;
  (void)rig.sensor.Command("plug VIRTUAL-0002");
  ASSERT_TRUE(Eventually([&] { return rig.provider.List().size() == 2; }));
  const auto second = rig.provider.Open("VIRTUAL-0002");
  EXPECT_EQ(second->description().serial, "VIRTUAL-0002");
  EXPECT_TRUE(second->info().intrinsics_assumed);  // it has no calibration file
  EXPECT_NEAR(second->info().intrinsics.fx, 570.34 / 2, 0.2);
  EXPECT_THAT(EnglishTexts(second->info().warnings),
              ::testing::Contains(HasSubstr("not calibrated")));
  const auto first = rig.provider.Open("VIRTUAL-0001");
  EXPECT_FALSE(first->info().intrinsics_assumed);
  (void)Take(*first, 2);
  (void)Take(*second, 2);
  rig.sensor.Unplug();  // the first
  EXPECT_THROW(Take(*first, 1000), DeviceLost);
  (void)Take(*second, 10);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)rig.provider.Open("VIRTUAL-0001"); }),
              HasSubstr("not attached, found VIRTUAL-0002"));
}

TEST(OpenNiSensorTest, SilenceIsADeviceErrorAndItsEndIsNone) {
  VirtualRig rig(SmallVirtualSensor(), std::chrono::milliseconds(300));
  const auto sensor = rig.provider.Open("");
  (void)Take(*sensor, 2);
  rig.sensor.Stall();
  EXPECT_THAT(MessageOf<DeviceError>([&] { Take(*sensor, 1000); }),
              HasSubstr("no pair of images for 300 ms"));
  rig.sensor.Resume();
  ASSERT_TRUE(Eventually([&] {
    try {
      return sensor->Next().has_value();
    } catch (const DeviceError&) {
      return false;
    }
  }));
}

TEST(OpenNiSensorTest, AnErrorOfTheDriverIsReportedAtOnce) {
  VirtualRig rig(SmallVirtualSensor(), std::chrono::minutes(10));
  const auto sensor = rig.provider.Open("");
  (void)Take(*sensor, 2);
  rig.sensor.Error();
  EXPECT_THAT(MessageOf<DeviceError>([&] { Take(*sensor, 1000); }), HasSubstr("reports an error"));
  rig.sensor.Resume();
  (void)Take(*sensor, 2);
}

TEST(OpenNiSensorTest, InterruptEndsAWaitForGood) {
  VirtualRig rig(SmallVirtualSensor(), std::chrono::minutes(10));
  const auto sensor = rig.provider.Open("");
  rig.sensor.Stall();
  std::future<int> reader = std::async(std::launch::async, [&] {
    int frames = 0;
    while (sensor->Next()) ++frames;
    return frames;
  });
  sensor->Interrupt();
  EXPECT_LT(reader.get(), 100);
  EXPECT_FALSE(sensor->Next());
}

TEST(OpenNiSensorTest, DiscardsAndCountsBadImages) {
  VirtualRig rig;
  const auto sensor = rig.provider.Open("");
  (void)Take(*sensor, 2);
  for (const char* kind : {"double", "old", "size"}) {
    const std::int64_t before = sensor->statistics().num_discarded;
    (void)rig.sensor.Command(fmt::format("glitch {} 10", kind));
    EXPECT_TRUE(Eventually([&] { return sensor->statistics().num_discarded >= before + 4; }))
        << kind;
  }
  const std::int64_t before = sensor->statistics().num_unpaired;
  (void)rig.sensor.Command("glitch lone 6");
  EXPECT_TRUE(Eventually([&] { return sensor->statistics().num_unpaired >= before + 3; }));
  EXPECT_GE(sensor->statistics().num_lost, 3) << "the colour images that never came";
  double last_s = 0;
  sensor->Flush();
  for (const Frame& frame : Take(*sensor, 5)) {
    EXPECT_GT(frame.depth_time_s, last_s);
    EXPECT_LT(std::abs(frame.depth_time_s - frame.color_time_s), 0.016);
    EXPECT_EQ(frame.color_rgb.cols, 320);
    last_s = frame.depth_time_s;
  }
}

TEST(OpenNiSensorTest, LateImagesAreKept) {
  VirtualRig rig;
  const auto sensor = rig.provider.Open("");
  (void)Take(*sensor, 2);
  (void)rig.sensor.Command("glitch late 3");
  const std::int64_t before = sensor->statistics().num_discarded;
  (void)Take(*sensor, 10);
  EXPECT_EQ(sensor->statistics().num_discarded, before);
}

TEST(OpenNiSensorTest, NextSceneShowsAnotherBodyAndHoldsStill) {
  VirtualRig rig;
  ASSERT_EQ(RenderScenes(SmallVirtualSensor()).names,
            (std::vector<std::string>{"reference", "moved"}));
  const auto sensor = rig.provider.Open("");
  const Frame first = sensor->Next().value();
  rig.sensor.NextScene();
  Frame other;
  ASSERT_TRUE(Eventually([&] {
    other = sensor->Next().value();
    return cv::norm(first.depth_m, other.depth_m, cv::NORM_INF) > 0.0;
  }));
  const Frame still = Take(*sensor, 3).back();
  EXPECT_EQ(cv::norm(still.depth_m, other.depth_m, cv::NORM_INF), 0.0);
  EXPECT_GT(still.depth_time_s, other.depth_time_s);
}

TEST(OpenNiSensorTest, RunsAtThirtyHertz) {
  VirtualRig rig;
  const auto sensor = rig.provider.Open("");
  const std::vector<Frame> frames = Take(*sensor, 60);
  EXPECT_NEAR(frames.back().depth_time_s - frames.front().depth_time_s, 59 / 30.0, 0.1);
  // Arrivals of the last second; a loaded machine delivers them unevenly.
  EXPECT_NEAR(sensor->statistics().frames_per_second, 30.0, 10.0);
  EXPECT_EQ(sensor->statistics().num_pairs, 60);
}

TEST(OpenNiSensorTest, ADamagedCalibrationIsRefusedByName) {
  VirtualRig rig;
  WriteWholeFile(rig.sensor.calibration_folder() / "VIRTUAL-0001.yaml",
                 std::string_view("%YAML:1.0\n---\nimage_width: 0\n"));
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)rig.provider.Open(""); }),
              HasSubstr("VIRTUAL-0001.yaml"));
}

TEST(OpenNiSensorTest, TheSensorMayOutliveItsProvider) {
  CommandedSensor virtual_sensor(SmallVirtualSensor());
  OpenNiOptions options;
  options.library = virtual_sensor.runtime_library();
  auto provider = std::make_unique<OpenNiProvider>(options);
  auto sensor = provider->Open("");
  provider.reset();
  (void)Take(*sensor, 2);
  virtual_sensor.Unplug();
  EXPECT_THROW(Take(*sensor, 1000), DeviceLost);
}

TEST(OpenNiSensorTest, TheLibraryStopsWhileUnitsComeAndGo) {
  const CommandedSensor virtual_sensor(SmallVirtualSensor());
  for (int round = 0; round < 10; ++round) {
    std::atomic<bool> closing = false;
    std::atomic<int> toggles = 0;
    OpenNiOptions options;
    options.library = virtual_sensor.runtime_library();
    options.before_stop = [&] {
      closing = true;
      virtual_sensor.Quit();
    };
    auto provider = std::make_unique<OpenNiProvider>(options);
    std::jthread toggler([&] {
      try {
        for (; !closing; ++toggles)
          toggles % 2 == 0 ? virtual_sensor.Unplug() : virtual_sensor.Plug();
      } catch (const DeviceError&) {
        // Sent after the driver had quit.
      }
    });
    while (toggles < 3) std::this_thread::yield();
    provider.reset();  // Hung when a callback was under way.
  }
}

TEST(OpenNiSensorTest, AMissingLibraryIsNamed) {
  OpenNiOptions options;
  options.library = "/nowhere/libOpenNI2.so.0";
  EXPECT_THAT(MessageOf<DeviceError>([&] { OpenNiProvider provider(options); }),
              HasSubstr("/nowhere/libOpenNI2.so.0"));
}

TEST(VirtualSensorTest, RendersAgainWhatTheCacheHoldsNoMore) {
  const testing::TempFolder folder;
  VirtualSensorOptions options = SmallVirtualSensor();
  options.frames = 3;
  options.max_scenes = 1;
  options.cache_folder = folder.path();
  int rendered = 0;
  const auto prepare = [&] {
    rendered = 0;
    const VirtualSensor sensor(options, {}, [&](double, std::string_view) { ++rendered; });
  };
  prepare();
  EXPECT_GT(rendered, 0);
  const std::filesystem::path stale =
      folder / "x.frames.partial-99999999";  // no process has this number
  WriteWholeFile(stale, std::string_view("half"));
  prepare();
  EXPECT_EQ(rendered, 0);
  EXPECT_FALSE(std::filesystem::exists(stale));
  const std::filesystem::path file = RenderScenes(options).caches.front();
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 1);
  prepare();
  EXPECT_GT(rendered, 0);
}

TEST(VirtualSensorTest, CommandsFailClearly) {
  const CommandedSensor alone(SmallVirtualSensor());
  EXPECT_THAT(MessageOf<DeviceError>([&] { alone.Plug(); }), HasSubstr("does not listen"));
  OpenNiOptions options;
  options.library = alone.runtime_library();
  OpenNiProvider provider(options);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)alone.Command("dance"); }),
              HasSubstr("unknown command dance"));
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)alone.Command("stall NOBODY"); }),
              HasSubstr("no such unit"));
  EXPECT_THAT(alone.Command("state"), HasSubstr("frames=20"));
}

}  // namespace
}  // namespace plumb
