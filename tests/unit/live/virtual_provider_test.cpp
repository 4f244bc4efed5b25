// SPDX-License-Identifier: Apache-2.0
// The virtual sensor in this process: frames as the simulator made them, plugs, faults, commands.
#include "drivers/simulator/player/virtual_provider.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/simulator/player/raw_frame.hpp"
#include "drivers/simulator/player/sweep_player.hpp"
#include "drivers/simulator/player/virtual_scenes.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::MessageOf;
using ::testing::Not;
using ::testing::SizeIs;

/// Two scenes of 20 frames at 320 x 240, as the tests of OpenNI2 have them.
VirtualSensorOptions Small() {
  VirtualSensorOptions options;
  options.frames = 20;
  options.width = 320;
  options.height = 240;
  options.cache_folder = PLUMB_VIRTUAL_CACHE;
  return options;
}

class VirtualProviderTest : public ::testing::Test {
 protected:
  VirtualProviderTest() {
    const RenderedScenes scenes = RenderScenes(Small());
    std::vector<std::string> caches;
    for (const auto& cache : scenes.caches) caches.push_back(cache.string());
    camera_file_ = scenes.camera_file;
    bus_ = std::make_shared<simulated::VirtualBus>(std::make_shared<simulated::Stage>(caches),
                                                   "VIRTUAL-0001");
    bus_->Obey("plug");
  }

  [[nodiscard]] VirtualProvider Provider(std::chrono::milliseconds stall_time) const {
    return VirtualProvider({.bus = bus_,
                            .settings = {.calibration_folder = {}, .markers_are_the_rooms = false},
                            .calibrations = {{"VIRTUAL-0001", camera_file_}},
                            .stall_time = stall_time});
  }

  std::string camera_file_;
  std::shared_ptr<simulated::VirtualBus> bus_;
};

TEST_F(VirtualProviderTest, EveryFrameOfASweepComesAsTheSimulatorMadeIt) {
  VirtualProvider provider = Provider(std::chrono::seconds(20));
  const auto sensor = provider.Open("");
  EXPECT_EQ(sensor->info().intrinsics.width, 320);
  const auto truth = simulated::MakeSource(simulated::PlanSuite(ScenesOf(Small())), 0);
  EXPECT_NEAR(sensor->info().intrinsics.fx, truth->info().intrinsics.fx, 1e-6);
  EXPECT_EQ(sensor->info().room_markers.reference, truth->info().room_markers.reference);
  std::vector<simulated::RawFrame> expected;  // rendered first: the sensor does not wait
  while (const std::optional<Frame> frame = truth->Next())
    expected.push_back(simulated::MakeRaw(*frame, truth->sweep().start_time_s));
  ASSERT_THAT(expected, SizeIs(static_cast<std::size_t>(Small().frames)));
  constexpr double kBegin_s = 900;  // later than anything by the clock of the unit
  bus_->Obey("rewind once 900000000");
  sensor->Flush();
  for (std::size_t count = 0; count < expected.size(); ++count) {
    const simulated::RawFrame& raw = expected[count];
    std::optional<Frame> frame;
    do {  // what was held still before the sweep has stamps of the unit's own clock
      frame = sensor->Next();
      ASSERT_TRUE(frame.has_value());
    } while (count == 0 && frame->color_time_s < kBegin_s);
    EXPECT_NEAR(frame->color_time_s, kBegin_s + 1e-6 * static_cast<double>(raw.stamps.color_us),
                1e-9);
    EXPECT_NEAR(frame->depth_time_s, kBegin_s + 1e-6 * static_cast<double>(raw.stamps.depth_us),
                1e-9);
    EXPECT_TRUE(std::equal(raw.rgb.begin(), raw.rgb.end(), frame->color_rgb.ptr<std::uint8_t>()));
    const float* depth = frame->depth_m.ptr<float>();
    for (std::size_t i = 0; i < raw.depth_mm.size(); ++i)
      ASSERT_NEAR(depth[i], 1e-3 * raw.depth_mm[i], 1e-6) << i;
  }
}

TEST_F(VirtualProviderTest, TheStateNamesTheLastFrameOnceThereIsOne) {
  EXPECT_THAT(bus_->Obey("state"), HasSubstr(" unit=VIRTUAL-0001 position=none"));
  VirtualProvider provider = Provider(std::chrono::seconds(20));
  const auto sensor = provider.Open("");
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (bus_->units().front()->position.load() != 0U) {  // The first frame, which is held still.
    ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    (void)sensor->Next();
  }
  EXPECT_THAT(bus_->Obey("state"), HasSubstr(" unit=VIRTUAL-0001 position=0"));
}

TEST_F(VirtualProviderTest, AStallWaitsForTheFrameOnItsWayAndEndsWithTheSweep) {
  using namespace std::chrono_literals;
  std::mutex mutex;
  std::condition_variable changed;
  bool is_on_its_way = false, has_stalled = false, stalled_too_early = false;
  std::vector<std::int64_t> stamps_after_us;
  const simulated::SweepPlayer player(
      bus_->units().front(), bus_->stage(), [] { return true; },
      [&](const simulated::PlayedPair& pair) {
        std::unique_lock lock(mutex);
        is_on_its_way = true;
        changed.notify_all();
        if (has_stalled)
          stamps_after_us.push_back(pair.stamps.color_us);
        else  // until the stall is answered, which has to wait for this frame
          stalled_too_early |= changed.wait_for(lock, 300ms, [&] { return has_stalled; });
      });
  std::unique_lock lock(mutex);
  ASSERT_TRUE(changed.wait_for(lock, 20s, [&] { return is_on_its_way; }));
  lock.unlock();
  bus_->Obey("stall");
  lock.lock();
  has_stalled = true;
  changed.notify_all();
  lock.unlock();
  bus_->Obey("rewind once 900000000");
  lock.lock();
  ASSERT_TRUE(changed.wait_for(lock, 20s, [&] { return stamps_after_us.size() > 2; }));
  EXPECT_FALSE(stalled_too_early);
  EXPECT_GE(stamps_after_us.front(), 900000000) << "a frame came between stall and sweep";
}

TEST_F(VirtualProviderTest, UnitsComeAndGoAndTheListenerHearsOfIt) {
  VirtualProvider provider = Provider(std::chrono::seconds(20));
  std::atomic<int> changes = 0;
  provider.SetListener([&] { ++changes; });
  const auto sensor = provider.Open("VIRTUAL-0001");
  ASSERT_TRUE(sensor->Next().has_value());
  bus_->Obey("unplug");
  EXPECT_EQ(changes, 1);
  EXPECT_THAT(provider.List(), IsEmpty());
  EXPECT_THROW(while (sensor->Next()){}, DeviceLost);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)provider.Open(""); }),
              HasSubstr("no sensor is attached"));
  bus_->Obey("plug OTHER");
  EXPECT_THAT(provider.List(), SizeIs(1));
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)provider.Open("VIRTUAL-0001"); }),
              HasSubstr("found OTHER"));
  const auto other = provider.Open("OTHER");
  EXPECT_TRUE(other->info().intrinsics_assumed) << "only the first unit is calibrated";
  EXPECT_TRUE(other->Next().has_value());
}

TEST_F(VirtualProviderTest, StallsErrorsAndWrongImagesAreWhatRealUnitsWouldReport) {
  VirtualProvider provider = Provider(std::chrono::milliseconds(300));
  const auto sensor = provider.Open("");
  ASSERT_TRUE(sensor->Next().has_value());
  bus_->Obey("glitch size 3");
  for (int i = 0; i < 6; ++i) ASSERT_TRUE(sensor->Next().has_value());
  EXPECT_EQ(sensor->statistics().num_discarded, 6) << "three of each stream";
  bus_->Obey("error");
  EXPECT_THAT(MessageOf<DeviceError>([&] {
                while (sensor->Next()) {
                }
              }),
              HasSubstr("reports an error"));
  bus_->Obey("resume");
  ASSERT_TRUE(sensor->Next().has_value());
  bus_->Obey("stall");
  EXPECT_THAT(MessageOf<DeviceError>([&] {
                while (sensor->Next()) {
                }
              }),
              HasSubstr("no pair of images for 300 ms"));
}

TEST_F(VirtualProviderTest, CommandsThatMakeNoSenseAreRefused) {
  EXPECT_THAT(bus_->Obey("dance"), HasSubstr("refused: unknown command dance"));
  EXPECT_THAT(bus_->Obey("speed -1"), HasSubstr("refused"));
  EXPECT_THAT(bus_->Obey("glitch none"), HasSubstr("refused"));
  EXPECT_THAT(bus_->Obey("stall NOBODY"), HasSubstr("no such unit"));
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)AcceptedAnswer("dance", bus_->Obey("dance")); }),
              HasSubstr("\"dance\""));
}

TEST(VirtualDriverTest, TheRegistrySetsItUpAndAScanBeginsWithTheSweep) {
  SensorRegistry registry;
  AddVirtualDriver(registry);
  ::setenv("XDG_CACHE_HOME", PLUMB_VIRTUAL_CACHE, 1);
  const auto setup =
      registry.Choose("virtual", true)
          .set_up({}, {.frames = 20, .width = 320, .height = 240, .max_scenes = 1}, {}, {});
  EXPECT_THAT(setup->Command("state"), HasSubstr("scenes=1 frames=20 unit=VIRTUAL-0001"));
  const auto provider = setup->MakeProvider();
  const auto sensor = provider->Open("");
  ASSERT_TRUE(sensor->Next().has_value());
  (void)setup->Command("stall");
  setup->BeforeScan();
  sensor->Flush();
  (void)setup->Command("resume");
  const std::optional<Frame> first = sensor->Next();
  ASSERT_TRUE(first.has_value());
  EXPECT_EQ(first->index, 0);
}

class RenderedScenesTest : public ::testing::Test {
 protected:
  RenderedScenesTest() {
    options_.frames = 3;
    options_.max_scenes = 1;
    options_.cache_folder = folder_.path();
  }
  RenderedScenes Render() {
    num_rendered_ = 0;
    return RenderScenes(options_, {}, [&](double, std::string_view) { ++num_rendered_; });
  }
  /// The one file of that kind.
  [[nodiscard]] std::filesystem::path File(const std::string& extension) const {
    std::filesystem::path found;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      if (entry.path().extension() != extension) continue;
      EXPECT_EQ(found, "") << "another one beside it: " << entry.path();
      found = entry.path();
    }
    return found;
  }
  /// Replaces a part of what was kept.
  void Tamper(const std::string& before, const std::string& after) const {
    std::string text = ReadTextFile(File(".scenes"), 1 << 20);
    const std::size_t at = text.find(before);
    ASSERT_NE(at, std::string::npos) << text;
    WriteWholeFile(File(".scenes"), text.replace(at, before.size(), after));
  }

  testing::TempFolder folder_;
  VirtualSensorOptions options_ = Small();
  int num_rendered_ = 0;
};

TEST_F(RenderedScenesTest, WhatTheSameProgramFoundOutIsTakenAsItIs) {
  const RenderedScenes first = Render();
  EXPECT_GT(num_rendered_, 0);
  const RenderedScenes again = Render();
  EXPECT_EQ(num_rendered_, 0);
  EXPECT_EQ(again.names, first.names);
  EXPECT_EQ(again.caches, first.caches);
  EXPECT_EQ(again.camera_file, first.camera_file);
  // A changed text in the kept file comes back, so the file was read and nothing was rendered.
  Tamper("image_width", "IMAGE_WIDTH");
  EXPECT_THAT(Render().camera_file, HasSubstr("IMAGE_WIDTH"));
  // Nothing is taken from another build of the program, for other options, or of a damaged file.
  Tamper("\"program_stamp\":\"", "\"program_stamp\":\"9");
  EXPECT_EQ(Render().camera_file, first.camera_file);
  EXPECT_EQ(num_rendered_, 0) << "the frames were the same";
  Tamper("image_width", "IMAGE_WIDTH");
  Tamper("{", "[");
  EXPECT_EQ(Render().camera_file, first.camera_file);
  Tamper("image_width", "IMAGE_WIDTH");
  options_.seed = 2;
  EXPECT_THAT(Render().camera_file, Not(HasSubstr("IMAGE_WIDTH")));
}

TEST_F(RenderedScenesTest, FramesThatWereReplacedAreLookedAtAndRenderedAgain) {
  (void)Render();
  const std::filesystem::path file = File(".frames");
  std::vector<std::uint8_t> bytes = ReadWholeFile(file, 1 << 21);
  const std::vector<std::uint8_t> before = bytes;
  bytes[1000] ^= 0xFF;  // in the first frame
  WriteWholeFile(file, bytes);
  (void)Render();
  EXPECT_GT(num_rendered_, 0);
  EXPECT_EQ(ReadWholeFile(file, 1 << 21), before);
  std::filesystem::remove(file);
  (void)Render();
  EXPECT_GT(num_rendered_, 0);
}

TEST_F(RenderedScenesTest, LoopsOfAnotherBodyAreOtherFiles) {
  options_.at_rest = true;
  options_.rate_hz = 1;  // 4 frames of a loop
  const auto of_first = Render().at_rest;
  options_.max_scenes = 2;
  const auto of_second = Render().at_rest;
  ASSERT_THAT(of_first, SizeIs(2));
  ASSERT_THAT(of_second, SizeIs(2));
  for (std::size_t i = 0; i < of_first.size(); ++i) EXPECT_NE(of_first[i], of_second[i]);
  options_.max_scenes = 1;
  EXPECT_EQ(Render().at_rest, of_first);
  EXPECT_EQ(num_rendered_, 0);
}

}  // namespace
}  // namespace plumb
