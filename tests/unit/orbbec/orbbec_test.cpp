// SPDX-License-Identifier: Apache-2.0
// The driver "orbbec" on a fake library: what it sets and reads, plugging, stalls, and cameras and
// libraries that it must refuse.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "tests/devices/orbbec/fake_orbbec.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fake = fake_orbbec;
using namespace orbbec;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::TempFolder;

const std::string kSerial = fake::FakeCamera().serial;
constexpr std::uint64_t kPeriod_us = 33'333;

fake::FakeMode Mode(int format, int width, int height, float focal, std::uint32_t rate_hz = 30) {
  return {.format = format,
          .rate_hz = rate_hz,
          .camera = {.fx = focal * static_cast<float>(width),
                     .fy = focal * static_cast<float>(width),
                     .cx = 0.5F * static_cast<float>(width - 1),
                     .cy = 0.5F * static_cast<float>(height - 1),
                     .width = static_cast<std::int16_t>(width),
                     .height = static_cast<std::int16_t>(height)},
          .lens = {}};
}

/// With modes of a Gemini 335, in an order of no meaning.
fake::FakeCamera Gemini() {
  fake::FakeCamera camera;
  camera.depth_modes = {Mode(kFormatY16, 640, 480, 0.5F), Mode(kFormatY16, 848, 480, 0.5F, 60),
                        Mode(kFormatY16, 848, 480, 0.5F), Mode(kFormatY16, 1280, 800, 0.5F)};
  camera.color_modes = {Mode(kFormatRgb, 1280, 720, 0.75F), Mode(5, 848, 480, 0.75F),
                        Mode(kFormatRgb, 1920, 1080, 0.75F)};
  camera.depth_to_color.translation = {14.0F, 0, 0};
  return camera;
}

class OrbbecTest : public ::testing::Test {
 protected:
  OrbbecTest() {
    fake::Reset();
    settings_.calibration_folder = folder_ / "calibration";
    settings_.library = PLUMB_FAKE_ORBBEC;
  }
  ~OrbbecTest() override {
    provider_.reset();
    EXPECT_EQ(fake::NumAlive(), 0) << "what the library gives out is given back";
    fake::Reset();
  }

  SensorProvider& Provider() {
    if (!provider_) {
      setup_ = BuiltInSensors().Choose("orbbec", false).set_up(settings_, {}, {}, {});
      provider_ = setup_->MakeProvider();
      provider_->SetListener([this] { ++num_changes_; });
    }
    return *provider_;
  }
  std::unique_ptr<LiveSensor> Open() { return OpenSensor(Provider(), ""); }

  void Deliver(cv::Mat image, std::uint64_t stamp_us, float scale_mm) {
    const bool is_depth = image.type() == CV_16UC1;
    EXPECT_TRUE(fake::Deliver(
        kSerial, {.is_depth = is_depth,
                  .format = is_depth ? kFormatY16 : kFormatRgb,
                  .width = static_cast<std::uint32_t>(image.cols),
                  .height = static_cast<std::uint32_t>(image.rows),
                  .bytes = static_cast<std::uint32_t>(image.total() * image.elemSize()),
                  .data = image.data,
                  .number = number_,
                  .stamp_us = stamp_us,
                  .scale_mm = scale_mm}));
  }
  void DeliverPair(cv::Size color, cv::Size depth, int value = 1000, float scale_mm = 1.0F) {
    ++number_;
    const std::uint64_t at_us = 5'000'000 + number_ * kPeriod_us;
    Deliver(cv::Mat(color, CV_8UC3, cv::Scalar(10, 20, 30)), at_us, 0.0F);
    Deliver(cv::Mat(depth, CV_16UC1, cv::Scalar(value)), at_us + 4000, scale_mm);
  }
  /// As many pairs as are left out while the exposure settles, and one that is not.
  void DeliverPairs(cv::Size color, cv::Size depth, int value = 1000, float scale_mm = 1.0F) {
    for (int i = 0; i < 20; ++i) DeliverPair(color, depth, value, scale_mm);
  }

  const TempFolder folder_;
  SensorSettings settings_;
  std::unique_ptr<SensorSetup> setup_;
  std::unique_ptr<SensorProvider> provider_;
  std::atomic<int> num_changes_ = 0;
  std::uint64_t number_ = 0;
};

TEST_F(OrbbecTest, DepthComesInItsOwnCameraAndColourHalved) {
  fake::Attach(Gemini());
  ASSERT_EQ(Provider().List().size(), 1U);
  const auto sensor = Open();
  EXPECT_EQ(sensor->description().name, "Orbbec Gemini 335");
  const StreamInfo& info = sensor->info();
  EXPECT_EQ(info.intrinsics.width, 640);  // 1280x720: its 848x480 is not RGB.
  EXPECT_DOUBLE_EQ(info.intrinsics.fx, 480.0);
  EXPECT_EQ(info.depth_sensor, DepthSensor::kActiveStereo);
  EXPECT_EQ(info.usable_depth, ClassOf(DepthSensor::kActiveStereo).range);
  EXPECT_TRUE(info.warnings.empty());
  DeliverPairs({1280, 720}, {848, 480});
  const std::optional<Frame> frame = sensor->Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->color_rgb.size(), cv::Size(640, 360));
  EXPECT_EQ(frame->color_rgb.at<cv::Vec3b>(100, 100), cv::Vec3b(10, 20, 30));
  ASSERT_EQ(frame->depth_m.size(), cv::Size(640, 360));
  EXPECT_FLOAT_EQ(frame->depth_m.at<float>(180, 320), 1.0F);
  EXPECT_NEAR(frame->depth_time_s - frame->color_time_s, 0.004, 1e-9)
      << "stamps are those of the camera";
}

TEST_F(OrbbecTest, ImagesStateTheUnitOfTheirDepth) {
  fake::Attach(Gemini());
  const auto sensor = Open();
  DeliverPairs({1280, 720}, {848, 480}, 10'000, 0.1F);
  std::optional<Frame> frame = sensor->Next();
  ASSERT_TRUE(frame);
  EXPECT_FLOAT_EQ(frame->depth_m.at<float>(180, 320), 1.0F);
  DeliverPair({1280, 720}, {848, 480}, 7000, 1.0F);  // What 16 bits do not hold is left out.
  while (sensor->statistics().num_pairs < 5) frame = sensor->Next();
  EXPECT_EQ(frame->depth_m.at<float>(180, 320), 0.0F);
}

TEST_F(OrbbecTest, ATimeOfFlightCameraHasItsClassAndLens) {
  fake::FakeCamera bolt = Gemini();
  bolt.name = "Orbbec Femto Bolt";
  bolt.firmware = "1.1.2";
  bolt.type = kDeviceTypeTof;
  bolt.depth_modes = {Mode(kFormatY16, 640, 576, 0.79F)};
  bolt.color_modes = {Mode(kFormatRgb, 1280, 720, 0.58F)};
  bolt.color_modes[0].lens = {.k1 = 0.08F,
                              .k2 = -0.1F,
                              .k3 = 0.04F,
                              .k4 = 0.01F,
                              .k5 = 0.02F,
                              .k6 = 0.03F,
                              .p1 = 0.001F,
                              .p2 = 0.002F,
                              .model = kDistortionBrownConradyK6};
  fake::Attach(bolt);
  const auto sensor = Open();
  EXPECT_EQ(sensor->info().depth_sensor, DepthSensor::kTimeOfFlight);
  const auto& lens = sensor->info().intrinsics.distortion;
  EXPECT_FLOAT_EQ(static_cast<float>(lens[0]), 0.08F);
  EXPECT_FLOAT_EQ(static_cast<float>(lens[2]), 0.001F) << "in OpenCV's order";
  ASSERT_EQ(sensor->info().warnings.size(), 1U);
  EXPECT_THAT(sensor->info().warnings[0].English(), HasSubstr("advises 1.1.3"));
  DeliverPairs({1280, 720}, {640, 576});
  EXPECT_TRUE(sensor->Next());
}

TEST_F(OrbbecTest, TheConfiguredExposureHoldsDuringAScan) {
  fake::Attach(Gemini());
  auto sensor = Open();
  EXPECT_EQ(fake::PropertyOf(kSerial, kPropertyLaser), 1);
  sensor->LockExposure(true);
  EXPECT_EQ(fake::PropertyOf(kSerial, kPropertyColorAutoExposure), 1) << "none is configured";
  sensor.reset();
  provider_.reset();
  settings_.exposure_us = 8000;
  sensor = Open();
  sensor->LockExposure(true);
  EXPECT_EQ(fake::PropertyOf(kSerial, kPropertyColorAutoExposure), 0);
  EXPECT_EQ(fake::PropertyOf(kSerial, kPropertyColorExposure), 80) << "100 us each";
  sensor->LockExposure(false);
  EXPECT_EQ(fake::PropertyOf(kSerial, kPropertyColorAutoExposure), 1);
}

TEST_F(OrbbecTest, UnpluggingEndsTheSensorAndItComesBack) {
  fake::Attach(Gemini());
  auto sensor = Open();
  const std::string uri = sensor->description().uri;
  DeliverPairs({1280, 720}, {848, 480});
  EXPECT_TRUE(sensor->Next());
  fake::Detach(kSerial);
  EXPECT_THAT(MessageOf<DeviceLost>([&] { (void)sensor->Next(); }), HasSubstr("was unplugged"));
  EXPECT_EQ(num_changes_, 1);
  sensor.reset();
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }), HasSubstr("no sensor is attached"));
  fake::Attach(Gemini());
  EXPECT_EQ(num_changes_, 2);
  sensor = Open();
  EXPECT_NE(sensor->description().uri, uri);
  DeliverPairs({1280, 720}, {848, 480});
  EXPECT_TRUE(sensor->Next());
}

TEST_F(OrbbecTest, AnOpenCameraIsStillListedWithItsFirmware) {
  fake::Attach(Gemini());
  const auto sensor = Open();
  EXPECT_EQ(Provider().List().size(), 1U) << "the library does not open it twice";
}

TEST_F(OrbbecTest, AStallIsToldWithWhatCame) {
  fake::Attach(Gemini());
  const auto sensor = Open();
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)sensor->Next(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("no pair of images for 3000 ms")));
}

TEST_F(OrbbecTest, ImagesOfAnotherSizeAreAFaultThatNamesBoth) {
  fake::Attach(Gemini());
  const auto sensor = Open();
  DeliverPair({1280, 720}, {640, 480});
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)sensor->Next(); }),
              AllOf(HasSubstr("depth"), HasSubstr("640x480"), HasSubstr("expected 848x480")));
}

TEST_F(OrbbecTest, AUsb2PortIsRefusedWithTheReason) {
  fake::FakeCamera camera = Gemini();
  camera.port = "USB2.1";
  fake::Attach(camera);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("USB 2.1"), HasSubstr("USB 3 port")));
}

TEST_F(OrbbecTest, TooOldFirmwareIsRefusedWithWhatUpdatesIt) {
  fake::FakeCamera camera = Gemini();
  camera.firmware = "1.2.9";
  fake::Attach(camera);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              AllOf(HasSubstr("1.2.9"), HasSubstr("1.2.20"), HasSubstr("OrbbecViewer")));
}

TEST_F(OrbbecTest, ACameraWithoutAModeOrInUseIsRefusedWithTheReason) {
  fake::FakeCamera camera = Gemini();
  camera.color_modes = {Mode(5, 1280, 720, 0.75F)};
  fake::Attach(camera);
  EXPECT_THAT(
      MessageOf<DeviceError>([&] { (void)Open(); }),
      AllOf(HasSubstr(kSerial), HasSubstr("no colour images"), HasSubstr("docs/orbbec.md")));
  fake::Detach(kSerial);
  camera = Gemini();
  camera.busy = true;
  fake::Attach(camera);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("busy")));
}

TEST_F(OrbbecTest, ADamagedFactoryCalibrationIsRefused) {
  fake::FakeCamera camera = Gemini();
  camera.color_modes[0].camera.fx = std::nanf("");
  fake::Attach(camera);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("calibration")));
  fake::Detach(kSerial);
  camera = Gemini();
  camera.depth_modes[2].lens = {.k1 = 0.1F, .model = kDistortionKannalaBrandt};
  fake::Attach(camera);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }), HasSubstr("model 5"));
}

TEST_F(OrbbecTest, OtherLibrariesAreRefusedWithWhatIsExpected) {
  const auto refusal = [&] { return MessageOf<DeviceError>([&] { (void)Provider().List(); }); };
  fake::SetVersion(11005);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("1.10.5"), HasSubstr("2.0")));
  settings_.library = "/usr/lib/nowhere/libOrbbecSDK.so.2.8";
  EXPECT_THAT(refusal(), AllOf(HasSubstr("nowhere"), HasSubstr("docs/orbbec.md")));
}

TEST_F(OrbbecTest, TheDoctorNamesLibraryAndCameras) {
  fake::FakeCamera camera = Gemini();
  camera.port = "USB2.1";
  fake::Attach(camera);
  std::string text;
  bool has_bad = false;
  for (const SensorFinding& finding : BuiltInSensors().Choose("orbbec", false).examine(settings_)) {
    text += finding.found.English() + " | " + finding.remedy.English() + "\n";
    has_bad = has_bad || finding.state == SensorFinding::State::kBad;
  }
  EXPECT_TRUE(has_bad);
  EXPECT_THAT(text, AllOf(HasSubstr("OrbbecSDK 2.8.7"), HasSubstr(PLUMB_FAKE_ORBBEC),
                          HasSubstr("firmware 1.8.10"), HasSubstr("USB 3 port")));
}

}  // namespace
}  // namespace plumb
