// SPDX-License-Identifier: Apache-2.0
// The driver "freenect" on a fake library: what it sets and reads, plugging, stalls, and Kinects
// and libraries that it must refuse.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <mutex>

#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/freenect/freenect_api.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "tests/devices/freenect/fake_freenect.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fake = fake_freenect;
using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::TempFolder;

const std::string kSerial = fake::FakeKinect().serial;
constexpr std::uint32_t kPeriod_ticks = 2'000'000;  // 60 MHz.

class FreenectTest : public ::testing::Test {
 protected:
  FreenectTest() {
    fake::Reset();
    settings_.calibration_folder = folder_ / "calibration";
    settings_.library = PLUMB_FAKE_FREENECT;
  }
  ~FreenectTest() override {
    provider_.reset();
    EXPECT_EQ(fake::NumAlive(), 0) << "what the library gives out is given back";
  }

  SensorProvider& Provider() {
    if (!provider_) {
      setup_ = BuiltInSensors().Choose("freenect", false).set_up(settings_, {}, {}, {});
      provider_ = setup_->MakeProvider();
      provider_->SetListener([this] {
        const std::lock_guard lock(mutex_);
        ++num_changes_;
        changed_.notify_all();
      });
    }
    return *provider_;
  }
  std::unique_ptr<LiveSensor> Open() { return OpenSensor(Provider(), ""); }
  bool AwaitChanges(int count) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, 20s, [&] { return num_changes_ >= count; });
  }
  /// As many pairs as are left out while the exposure settles, and one that is not.
  void DeliverPairs() {
    cv::Mat color(480, 640, CV_8UC3, cv::Scalar(10, 20, 30));
    cv::Mat depth(480, 640, CV_16UC1, cv::Scalar(750));
    for (int i = 0; i < 20; ++i) {
      stamp_ += kPeriod_ticks;
      EXPECT_TRUE(fake::Deliver(kSerial, false, color.data, stamp_));
      EXPECT_TRUE(fake::Deliver(kSerial, true, depth.data, stamp_ + 120'000));
    }
  }

  const TempFolder folder_;
  SensorSettings settings_;
  std::unique_ptr<SensorSetup> setup_;
  std::unique_ptr<SensorProvider> provider_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int num_changes_ = 0;
  std::uint32_t stamp_ = 6'000'000;
};

TEST_F(FreenectTest, ImagesComeRegisteredWithTheStampsOfTheKinect) {
  fake::Attach({});
  ASSERT_EQ(Provider().List().size(), 1U);
  const auto sensor = Open();
  EXPECT_EQ(sensor->description().serial, kSerial);
  const StreamInfo& info = sensor->info();
  EXPECT_EQ(info.intrinsics.width, 640);
  EXPECT_TRUE(info.intrinsics_assumed) << "the Kinect states no lens";
  EXPECT_EQ(info.depth_sensor, DepthSensor::kStructuredLight);
  DeliverPairs();
  const std::optional<Frame> frame = sensor->Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->color_rgb.at<cv::Vec3b>(100, 100), cv::Vec3b(10, 20, 30));
  EXPECT_FLOAT_EQ(frame->depth_m.at<float>(240, 320), 0.75F);
  EXPECT_NEAR(frame->depth_time_s - frame->color_time_s, 0.002, 1e-9);
}

TEST_F(FreenectTest, StampsPassTheEndOfTheKinectsCounter) {
  stamp_ = 0U - 17 * kPeriod_ticks;  // After 71 s.
  fake::Attach({});
  const auto sensor = Open();
  double before_s = 0.0;
  DeliverPairs();
  for (int i = 0; i < 4; ++i) {
    const std::optional<Frame> frame = sensor->Next();
    ASSERT_TRUE(frame);
    if (i > 0) {
      EXPECT_NEAR(frame->color_time_s - before_s, 1.0 / 30.0, 1e-5);
    }
    before_s = frame->color_time_s;
  }
}

TEST_F(FreenectTest, TheUnitsOwnCalibrationTakesPrecedence) {
  std::filesystem::create_directories(folder_ / "calibration");
  WriteWholeFile(folder_ / "calibration" / (kSerial + ".yaml"),
                 std::string("%YAML:1.0\nimage_width: 640\nimage_height: 480\n"
                             "camera_matrix: [531., 0., 320., 0., 530., 240., 0., 0., 1.]\n"
                             "distortion_coefficients: [0.05, -0.1, 0., 0., 0.]\n"));
  fake::Attach({});
  const auto sensor = Open();
  EXPECT_EQ(sensor->info().intrinsics.fx, 531.0);
  EXPECT_FALSE(sensor->info().intrinsics_assumed);
}

TEST_F(FreenectTest, ExposureAndWhiteBalanceAreHeldDuringAScan) {
  fake::Attach({});
  const auto sensor = Open();
  sensor->LockExposure(true);
  EXPECT_EQ(fake::FlagOf(kSerial, freenect::kAutoExposure), 0);
  EXPECT_EQ(fake::FlagOf(kSerial, freenect::kAutoWhiteBalance), 0);
  sensor->LockExposure(false);
  EXPECT_EQ(fake::FlagOf(kSerial, freenect::kAutoExposure), 1);
}

TEST_F(FreenectTest, UnpluggingEndsTheSensorAndItComesBack) {
  fake::Attach({});
  auto sensor = Open();
  const std::string uri = sensor->description().uri;
  DeliverPairs();
  EXPECT_TRUE(sensor->Next());
  fake::Detach(kSerial);
  EXPECT_THAT(MessageOf<DeviceLost>([&] {
                while (sensor->Next()) continue;
              }),
              HasSubstr("was unplugged"));
  sensor.reset();
  ASSERT_TRUE(AwaitChanges(2)) << "the events and the bus tell of it";
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }), HasSubstr("no sensor is attached"));
  fake::Attach({});
  ASSERT_TRUE(AwaitChanges(3)) << "the bus is looked at, as the library tells nothing";
  sensor = Open();
  EXPECT_NE(sensor->description().uri, uri);
  DeliverPairs();
  EXPECT_TRUE(sensor->Next());
}

TEST_F(FreenectTest, AStallIsToldWithWhatCame) {
  fake::Attach({});
  const auto sensor = Open();
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)sensor->Next(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("no pair of images for 3000 ms")));
}

TEST_F(FreenectTest, WithoutRegisteredDepthOfItsSizeItIsRefused) {
  fake::Attach({.has_registered = false});
  EXPECT_THAT(
      MessageOf<DeviceError>([&] { (void)Open(); }),
      AllOf(HasSubstr(kSerial), HasSubstr("no depth images"), HasSubstr("docs/freenect.md")));
}

TEST_F(FreenectTest, AKinectInUseIsRefusedWithTheReason) {
  fake::Attach({.busy = true});
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("end other programs")));
}

TEST_F(FreenectTest, OtherLibrariesAreRefusedWithWhatIsExpected) {
  const auto refusal = [&] { return MessageOf<DeviceError>([&] { (void)Provider().List(); }); };
  settings_.library = "/usr/lib/nowhere/libfreenect.so.0.5";
  EXPECT_THAT(refusal(), AllOf(HasSubstr("nowhere"), HasSubstr("docs/freenect.md")));
  settings_.library = "libz.so.1";
  EXPECT_THAT(refusal(), HasSubstr("freenect_init"));
}

TEST_F(FreenectTest, TheDoctorNamesLibraryAndKinects) {
  fake::Attach({});
  std::string text;
  for (const SensorFinding& finding : BuiltInSensors().Choose("freenect", false).examine(settings_))
    text += finding.found.English() + "\n";
  EXPECT_THAT(text, AllOf(HasSubstr("libfreenect 0.5"), HasSubstr(PLUMB_FAKE_FREENECT),
                          HasSubstr("Kinect " + kSerial)));
}

}  // namespace
}  // namespace plumb
