// SPDX-License-Identifier: Apache-2.0
// A driver that only this test knows, from its name in a configuration file to a stored scan: what
// somebody does who adds a sensor.
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "daemon/config/sensor_settings.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/plumbd/stored_scan.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::ScanWith;
using testing::StoredScan;

constexpr int kFrames = 90;

/// What the driver states of its sensor: the depth of a stereo camera.
constexpr DepthNoise kItsNoise = {.constant_m = 0.0005,
                                  .linear_m_per_m = 0.0,
                                  .quadratic_m_per_m2 = 0.004,
                                  .origin_m = 0.0,
                                  .grazing_m = 0.0};

/// A sweep of the simulator's demo at 15 Hz: made once, read by all sensors.
struct Sweep {
  Sweep() {
    const auto source = testing::DemoSweep(kFrames);
    info = source->info();
    while (std::optional<Frame> frame = source->Next()) frames.push_back(std::move(*frame));
  }
  StreamInfo info;
  std::vector<Frame> frames;
  std::atomic<bool> begins = false;  ///< The next frame is the sweep's first.
};

/// Gives the first frame again and again, the sweep once a scan has begun, then its last frame.
class SweepSensor : public LiveSensor {
 public:
  SweepSensor(std::shared_ptr<Sweep> sweep, const SensorSettings& settings)
      : sweep_(std::move(sweep)), info_(sweep_->info) {
    info_.depth_noise = kItsNoise;
    info_.room_markers = settings.room_markers;
  }
  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] const SensorDescription& description() const override { return description_; }
  [[nodiscard]] SensorStatistics statistics() const override {
    return {.num_pairs = num_given_, .frames_per_second = 15.0};
  }
  void Interrupt() noexcept override {
    {
      const std::lock_guard lock(mutex_);
      interrupted_ = true;
    }
    changed_.notify_all();
  }
  void Flush() noexcept override {}
  void LockExposure(bool) override {}

  std::optional<Frame> Next() override {
    if (sweep_->begins.exchange(false)) position_ = 0;
    std::unique_lock lock(mutex_);
    // Slower than the sweep was: every frame is tracked, on a busy machine too.
    if (changed_.wait_for(lock, std::chrono::milliseconds(80), [&] { return interrupted_; }))
      return std::nullopt;
    Frame frame = sweep_->frames.at(std::min<std::size_t>(position_, kFrames - 1));
    frame.index = num_given_++;
    frame.color_time_s = frame.depth_time_s = static_cast<double>(frame.index) / 15.0;
    if (is_sweeping()) ++position_;
    return frame;
  }

 private:
  [[nodiscard]] bool is_sweeping() const { return position_ < kFrames; }

  const std::shared_ptr<Sweep> sweep_;
  StreamInfo info_;
  const SensorDescription description_{
      .uri = "sweep:1", .serial = "SWEEP-1", .name = "a sensor of the test's own"};
  std::mutex mutex_;
  std::condition_variable changed_;
  bool interrupted_ = false;
  std::size_t position_ = kFrames;
  std::atomic<std::int64_t> num_given_ = 0;
};

class SweepProvider : public SensorProvider {
 public:
  SweepProvider(std::shared_ptr<Sweep> sweep, SensorSettings settings)
      : sweep_(std::move(sweep)), settings_(std::move(settings)) {}
  [[nodiscard]] std::vector<SensorDescription> List() override {
    return {{.uri = "sweep:1", .serial = "SWEEP-1", .name = "a sensor of the test's own"}};
  }
  void SetListener(std::function<void()>) override {}
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::string&) override {
    return std::make_unique<SweepSensor>(sweep_, settings_);
  }

 private:
  const std::shared_ptr<Sweep> sweep_;
  const SensorSettings settings_;
};

class SweepSetup : public SensorSetup {
 public:
  SweepSetup(SensorSettings settings, std::shared_ptr<Sweep> sweep)
      : settings_(std::move(settings)), sweep_(std::move(sweep)) {}
  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    return std::make_unique<SweepProvider>(sweep_, settings_);
  }
  void BeforeScan() const override { sweep_->begins = true; }

 private:
  const SensorSettings settings_;
  const std::shared_ptr<Sweep> sweep_;
};

/// The whole of what the new folder would contribute to a build.
void AddSweepDriver(SensorRegistry& registry, const std::shared_ptr<Sweep>& sweep) {
  registry.Add({.name = "sweep",
                .title = "the test's own",
                .set_up = [sweep](const SensorSettings& settings, const SimulatedSweeps&,
                                  const std::stop_token&, const SetUpProgress&) {
                  return std::make_unique<SweepSetup>(settings, sweep);
                }});
}

class OwnDriverTest : public ::testing::Test {
 protected:
  OwnDriverTest() { AddSweepDriver(registry_, sweep_); }
  const std::shared_ptr<Sweep> sweep_ = std::make_shared<Sweep>();
  SensorRegistry registry_;
};

/// The surface of a recording if its sensor has this noise.
std::vector<Eigen::Vector3f> Surface(const std::filesystem::path& recording,
                                     const std::optional<DepthNoise>& noise) {
  const auto source = OpenTumRecording(recording);
  StreamInfo info = source->info();
  info.depth_noise = noise.value_or(info.depth_noise);
  Reconstructor reconstructor(info, {});
  while (const std::optional<Frame> frame = source->Next()) reconstructor.AddFrame(*frame);
  return reconstructor.Finish().cloud.points;
}

TEST_F(OwnDriverTest, AScanWithItIsStoredAsThePatientsReferenceAndItsNoiseWithTheRecording) {
  EventLoop loop;  // first: blocks signals before any thread starts
  const testing::TempFolder folder;
  Config config = ParseConfig(
      fmt::format("[sensor]\ndriver = \"sweep\"\n"
                  "[markers]\ndictionary = \"{}\"\nlength_m = {}\nreference = {}\n",
                  sweep_->info.room_markers.dictionary, sweep_->info.room_markers.length_m,
                  sweep_->info.room_markers.reference.value()),
      "plumb.toml");
  config.appliance.state = folder / "state";
  const std::unique_ptr<SensorSetup> setup = registry_.Choose(config.appliance.sensor_driver, false)
                                                 .set_up(SensorSettingsOf(config), {}, {}, {});
  const StoredScan stored = ScanWith(loop, *setup, config, kFrames);
  const nlohmann::json& status = stored.status;
  EXPECT_EQ(status["sensor"]["serial"], "SWEEP-1") << status.dump(2);
  EXPECT_EQ(status["last_result"]["is_reference"], true);
  const std::filesystem::path& scan = stored.folder;
  EXPECT_TRUE(std::filesystem::exists(scan / "scene" / "scene.json"));
  const std::filesystem::path recording = scan / "recording";
  ASSERT_TRUE(std::filesystem::exists(recording));
  EXPECT_EQ(OpenTumRecording(recording)->info().depth_noise, kItsNoise);
  const auto replayed = Surface(recording, {});
  EXPECT_EQ(replayed, Surface(recording, kItsNoise));
  EXPECT_NE(replayed, Surface(recording, DepthNoise())) << "what the driver states has no effect";
}

TEST_F(OwnDriverTest, ANameThatIsMisspeltIsAnsweredWithTheNamesThatAreKnown) {
  const Config config = ParseConfig("[sensor]\ndriver = \"seep\"\n", "plumb.toml");
  EXPECT_THAT(
      MessageOf<DataError>([&] { (void)registry_.Choose(config.appliance.sensor_driver, false); }),
      AllOf(HasSubstr("[sensor] driver"), HasSubstr("\"sweep\""), HasSubstr("\"seep\"")));
  EXPECT_THAT(
      MessageOf<DataError>([] { (void)ParseConfig("[sensor]\ndriver = 7\n", "plumb.toml"); }),
      AllOf(HasSubstr("plumb.toml:2"), HasSubstr("sensor.driver")));
}

}  // namespace
}  // namespace plumb
