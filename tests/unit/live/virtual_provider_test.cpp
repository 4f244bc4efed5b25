// The virtual sensor in this process: frames as the simulator made them, plugs, faults, commands.
#include "drivers/virtual/virtual_provider.hpp"

#include <atomic>
#include <chrono>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "drivers/simulated/suite_plan.hpp"
#include "drivers/virtual/raw_frame.hpp"
#include "drivers/virtual/virtual_scenes.hpp"
#include "tests/support/message_of.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::MessageOf;
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
    camera_ = scenes.camera;
    bus_ = std::make_shared<simulated::VirtualBus>(std::make_shared<simulated::Stage>(caches),
                                                   "VIRTUAL-0001");
    bus_->Obey("plug");
  }

  [[nodiscard]] VirtualProvider Provider(std::chrono::milliseconds stall_time) const {
    return VirtualProvider({.bus = bus_,
                            .settings = {.calibration_folder = {}},
                            .serial = "VIRTUAL-0001",
                            .calibration = CameraFileText(camera_, 1000.0),
                            .stall_time = stall_time});
  }

  StreamInfo camera_;
  std::shared_ptr<simulated::VirtualBus> bus_;
};

TEST_F(VirtualProviderTest, EveryFrameOfASweepComesAsTheSimulatorMadeIt) {
  VirtualProvider provider = Provider(std::chrono::seconds(20));
  const auto sensor = provider.Open("");
  EXPECT_EQ(sensor->info().intrinsics.width, 320);
  EXPECT_NEAR(sensor->info().intrinsics.fx, camera_.intrinsics.fx, 1e-6);
  EXPECT_EQ(sensor->info().reference_marker, camera_.reference_marker);
  const auto truth = simulated::MakeSource(simulated::PlanSuite(ScenesOf(Small())), 0);
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

TEST_F(VirtualProviderTest, AfterAStallTheNextFramesAreThoseOfTheSweep) {
  VirtualProvider provider = Provider(std::chrono::seconds(20));
  bus_->Obey("speed 20");
  for (int round = 1; round <= 5; ++round) {
    bus_->Obey("hold");
    const auto sensor = provider.Open("");  // each time: stamps that go back are discarded
    bus_->Obey("glitch late 10000");        // each one is on its way for 0.1 s
    ASSERT_TRUE(sensor->Next().has_value());
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    bus_->Obey("stall");
    sensor->Flush();  // a frame after it would be one that the stall has not stopped
    bus_->Obey("rewind once 900000000");
    const std::optional<Frame> frame = sensor->Next();
    ASSERT_TRUE(frame.has_value());
    EXPECT_GE(frame->color_time_s, 900.0) << "round " << round;
    bus_->Obey("glitch late 0");
  }
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

}  // namespace
}  // namespace plumb
