// SPDX-License-Identifier: Apache-2.0
// The driver "realsense" on a fake library: what it sets and reads, plugging, stalls, and cameras
// and libraries that it must refuse.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>

#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/realsense/realsense_library.hpp"
#include "drivers/realsense/realsense_stamps.hpp"
#include "tests/devices/realsense/fake_realsense.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fake = fake_realsense;
using namespace realsense;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::TempFolder;

constexpr const char* kSerial = "728612070259";
constexpr std::int64_t kPeriod_us = 33'333;

RsIntrinsics Camera(int width, int height, float f) {
  return {.width = width,
          .height = height,
          .ppx = 0.5F * static_cast<float>(width - 1),
          .ppy = 0.5F * static_cast<float>(height - 1),
          .fx = f,
          .fy = f};
}

fake::FakeMode Depth(int width, int height, int rate_hz = 30) {
  return {kStreamDepth, kFormatZ16, rate_hz,
          Camera(width, height, 0.5F * static_cast<float>(width))};
}

fake::FakeMode Color(int width, int height, int format = kFormatRgb8) {
  return {kStreamColor, format, 30, Camera(width, height, 0.75F * static_cast<float>(width))};
}

/// With the modes of a D435, in an order of no meaning.
fake::FakeUnit D435() {
  fake::FakeUnit unit;
  unit.depth_modes = {Depth(640, 480), Depth(848, 480, 90), Depth(848, 480), Depth(1280, 720)};
  unit.color_modes = {Color(1280, 720), Color(848, 480, 6), Color(1920, 1080)};
  unit.depth_to_color.translation = {0.015F, 0, 0};
  return unit;
}

class RealSenseTest : public ::testing::Test {
 protected:
  RealSenseTest() {
    fake::Reset();
    settings_.calibration_folder = folder_ / "calibration";
    settings_.library = PLUMB_FAKE_REALSENSE;
  }
  ~RealSenseTest() override {
    provider_.reset();
    EXPECT_EQ(fake::NumAlive(), 0) << "what the library gives out is given back";
    fake::Reset();
  }

  SensorProvider& Provider() {
    if (!provider_) {
      setup_ = BuiltInSensors().Choose("realsense", false).set_up(settings_, {}, {}, {});
      provider_ = setup_->MakeProvider();
      provider_->SetListener([this] { ++num_changes_; });
    }
    return *provider_;
  }
  std::unique_ptr<LiveSensor> Open() { return OpenSensor(Provider(), ""); }

  static bool Deliver(const cv::Mat& image, std::int64_t n, std::map<int, std::int64_t> metadata,
                      double timestamp_ms = 0.0) {
    const bool is_color = image.type() == CV_8UC3;
    return fake::Deliver(kSerial, {.stream = is_color ? kStreamColor : kStreamDepth,
                                   .format = is_color ? kFormatRgb8 : kFormatZ16,
                                   .width = image.cols,
                                   .height = image.rows,
                                   .stride = static_cast<int>(image.step),
                                   .data = image.data,
                                   .number = static_cast<std::uint64_t>(n),
                                   .timestamp_ms = timestamp_ms,
                                   .metadata = std::move(metadata)});
  }
  /// As many pairs as are left out while the exposure settles, and one that is not.
  void DeliverPairs(cv::Size color, cv::Size depth) {
    for (int i = 0; i < 20; ++i) DeliverPair(color, depth);
  }
  void DeliverPair(cv::Size color, cv::Size depth) {
    ++number_;
    const std::int64_t at_us = first_us_ + number_ * kPeriod_us;
    EXPECT_TRUE(Deliver(cv::Mat(color, CV_8UC3, cv::Scalar(10, 20, 30)), number_,
                        {{kMetadataSensorTimestamp, at_us % (std::int64_t{1} << 32)}}));
    EXPECT_TRUE(Deliver(cv::Mat(depth, CV_16UC1, cv::Scalar(2000)), number_,
                        {{kMetadataSensorTimestamp, (at_us + 4000) % (std::int64_t{1} << 32)}}));
  }

  const TempFolder folder_;
  SensorSettings settings_;
  std::unique_ptr<SensorSetup> setup_;
  std::unique_ptr<SensorProvider> provider_;
  std::atomic<int> num_changes_ = 0;
  std::int64_t number_ = 0;
  std::int64_t first_us_ = 1'000'000;
};

TEST_F(RealSenseTest, DepthComesInItsOwnCameraAndColourHalved) {
  fake::FakeUnit unit = D435();
  unit.depth_unit_m = 0.0005F;
  fake::Attach(unit);
  ASSERT_EQ(Provider().List().size(), 1U);
  const auto sensor = Open();
  EXPECT_EQ(sensor->description().name, "Intel RealSense D435");
  const StreamInfo& info = sensor->info();
  EXPECT_EQ(info.intrinsics.width, 640);  // 1280x720: its 848x480 is not RGB.
  EXPECT_EQ(info.intrinsics.height, 360);
  EXPECT_DOUBLE_EQ(info.intrinsics.fx, 480.0);
  EXPECT_DOUBLE_EQ(info.intrinsics.cx, 319.5);
  EXPECT_EQ(info.depth_sensor, DepthSensor::kActiveStereo);
  EXPECT_EQ(info.depth_noise, ClassOf(DepthSensor::kActiveStereo).noise);
  EXPECT_EQ(info.usable_depth, ClassOf(DepthSensor::kActiveStereo).range);
  EXPECT_FALSE(info.intrinsics_assumed);
  DeliverPairs({1280, 720}, {848, 480});
  const std::optional<Frame> frame = sensor->Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->color_rgb.size(), cv::Size(640, 360));
  EXPECT_EQ(frame->color_rgb.at<cv::Vec3b>(100, 100), cv::Vec3b(10, 20, 30));
  ASSERT_EQ(frame->depth_m.size(), cv::Size(640, 360));
  EXPECT_FLOAT_EQ(frame->depth_m.at<float>(180, 320), 1.0F);
  // The depth camera sees 0.848 m to each side at 1 m, and stands 15 mm to the left of colour,
  // which sees 0.667 m.
  EXPECT_GT(cv::countNonZero(frame->depth_m), 640 * 360 * 98 / 100);
  EXPECT_NEAR(frame->depth_time_s - frame->color_time_s, 0.004, 1e-9);
}

TEST_F(RealSenseTest, ProjectorPresetAndClockAreSet) {
  fake::Attach(D435());
  const auto sensor = Open();
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamDepth, kOptionPreset), kPresetHighAccuracy);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamDepth, kOptionEmitter), 1.0F);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamDepth, kOptionLaserPower), 150.0F);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamDepth, kOptionGlobalTime), 0.0F);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamColor, kOptionGlobalTime), 0.0F);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamColor, kOptionAutoExposurePriority), 0.0F);
  sensor->LockExposure(true);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamColor, kOptionAutoExposure), 1.0F)
      << "not configured: what the camera would fall back to is not known";
}

TEST_F(RealSenseTest, TheConfiguredExposureHoldsDuringAScan) {
  settings_.exposure_us = 8000;
  fake::Attach(D435());
  const auto sensor = Open();
  sensor->LockExposure(true);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamColor, kOptionAutoExposure), 0.0F);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamColor, kOptionExposure), 80.0F) << "100 us each";
  sensor->LockExposure(false);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamColor, kOptionAutoExposure), 1.0F);
}

TEST_F(RealSenseTest, OneModuleMayDeliverBothStreams) {
  fake::FakeUnit d405 = D435();
  d405.color_modes.clear();
  d405.depth_modes = {Depth(848, 480), Color(848, 480)};
  fake::Attach(d405);
  settings_.exposure_us = 8000;
  const auto sensor = Open();
  DeliverPairs({848, 480}, {848, 480});
  EXPECT_TRUE(sensor->Next());
  sensor->LockExposure(true);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamColor, kOptionExposure), 8000.0F) << "1 us each";
}

TEST_F(RealSenseTest, TheUnitsOwnCalibrationTakesPrecedence) {
  std::filesystem::create_directories(folder_ / "calibration");
  WriteWholeFile(folder_ / "calibration" / "728612070259.yaml",
                 std::string("%YAML:1.0\nimage_width: 640\nimage_height: 360\n"
                             "camera_matrix: [470., 0., 320., 0., 470., 180., 0., 0., 1.]\n"
                             "distortion_coefficients: [0.05, -0.1, 0., 0., 0.]\n"));
  fake::Attach(D435());
  const auto sensor = Open();
  EXPECT_EQ(sensor->info().intrinsics.fx, 470.0);
  EXPECT_EQ(sensor->info().intrinsics.distortion[0], 0.05);
  EXPECT_EQ(sensor->info().depth_sensor, DepthSensor::kActiveStereo);
  EXPECT_EQ(sensor->info().usable_depth, ClassOf(DepthSensor::kActiveStereo).range);
}

TEST_F(RealSenseTest, UnpluggingEndsTheSensorAndItComesBack) {
  fake::Attach(D435());
  auto sensor = Open();
  const std::string uri = sensor->description().uri;
  DeliverPairs({1280, 720}, {848, 480});
  EXPECT_TRUE(sensor->Next());
  fake::Detach(kSerial);
  EXPECT_THAT(MessageOf<DeviceLost>([&] { (void)sensor->Next(); }), HasSubstr("was unplugged"));
  EXPECT_EQ(num_changes_, 1);
  sensor.reset();
  EXPECT_TRUE(Provider().List().empty());
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }), HasSubstr("no sensor is attached"));
  fake::Attach(D435());
  EXPECT_EQ(num_changes_, 2);
  sensor = Open();
  EXPECT_NE(sensor->description().uri, uri);
  DeliverPairs({1280, 720}, {848, 480});
  EXPECT_TRUE(sensor->Next());
}

TEST_F(RealSenseTest, AnotherUnitThatIsUnpluggedDoesNotMatter) {
  fake::Attach(D435());
  fake::FakeUnit other = D435();
  other.serial = "900000000001";
  fake::Attach(other);
  EXPECT_EQ(Provider().List().size(), 2U);
  const auto sensor = Open();
  EXPECT_EQ(sensor->description().serial, kSerial);
  fake::Detach("900000000001");
  DeliverPairs({1280, 720}, {848, 480});
  EXPECT_TRUE(sensor->Next());
}

TEST_F(RealSenseTest, AStallIsToldWithWhatCame) {
  fake::Attach(D435());
  const auto sensor = Open();
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)sensor->Next(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("no pair of images for 3000 ms")));
}

TEST_F(RealSenseTest, ImagesOfAnotherSizeAreAFaultThatNamesBoth) {
  fake::Attach(D435());
  const auto sensor = Open();
  DeliverPair({1280, 720}, {640, 480});
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)sensor->Next(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("depth"), HasSubstr("640x480"),
                    HasSubstr("expected 848x480")));
}

TEST_F(RealSenseTest, AUsb2PortIsRefusedWithTheReason) {
  fake::FakeUnit unit = D435();
  unit.usb = "2.1";
  fake::Attach(unit);
  EXPECT_EQ(Provider().List().size(), 1U);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("USB 2.1"), HasSubstr("USB 3 port")));
}

TEST_F(RealSenseTest, FirmwareIsComparedNumberByNumber) {
  fake::FakeUnit unit = D435();
  unit.firmware = "5.9.2.100";
  fake::Attach(unit);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              AllOf(HasSubstr("5.9.2.100"), HasSubstr("5.9.3.0"), HasSubstr("rs-fw-update")));
  fake::Reset();
  unit.firmware = "5.12.7.100";
  fake::Attach(unit);
  const auto sensor = Open();
  ASSERT_EQ(sensor->info().warnings.size(), 1U);
  EXPECT_THAT(sensor->info().warnings[0].English(),
              AllOf(HasSubstr("5.12.7.100"), HasSubstr("5.16.0.1")));
}

TEST_F(RealSenseTest, ACameraWithoutAModeOrInUseIsRefusedWithTheReason) {
  fake::FakeUnit unit = D435();
  unit.depth_modes = {Depth(256, 144)};
  fake::Attach(unit);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("no depth images")));
  fake::Reset();
  unit = D435();
  unit.busy = true;
  fake::Attach(unit);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("busy")));
}

TEST_F(RealSenseTest, ADamagedFactoryCalibrationIsRefused) {
  fake::FakeUnit unit = D435();
  for (fake::FakeMode& mode : unit.color_modes) mode.camera.fx = std::nanf("");
  fake::Attach(unit);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              AllOf(HasSubstr(kSerial), HasSubstr("calibration")));
  fake::Reset();
  unit = D435();
  unit.color_modes[0].camera.model = 3;  // F-theta.
  unit.color_modes[0].camera.coefficients[0] = 0.1F;
  fake::Attach(unit);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }), HasSubstr("model 3"));
  fake::Reset();
  unit = D435();
  unit.depth_unit_m = 0.0F;
  fake::Attach(unit);
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)Open(); }),
              HasSubstr("calibration of its factory"));
}

TEST_F(RealSenseTest, StampsPassTheEndOfTheCamerasCounter) {
  first_us_ = (std::int64_t{1} << 32) - 25 * kPeriod_us;
  fake::Attach(D435());
  const auto sensor = Open();
  DeliverPairs({1280, 720}, {848, 480});
  double before_s = sensor->Next()->depth_time_s;
  for (int i = 0; i < 10; ++i) {
    DeliverPair({1280, 720}, {848, 480});
    while (const std::optional<Frame> frame = sensor->Next()) {
      EXPECT_NEAR(frame->depth_time_s - before_s, 1e-6 * kPeriod_us, 1e-6);
      before_s = frame->depth_time_s;
      if (frame->depth_time_s > 1e-6 * static_cast<double>(first_us_ + number_ * kPeriod_us)) break;
    }
  }
  EXPECT_GT(before_s, 4294.967296);
}

TEST(RealSenseStampsTest, WithoutMetadataHalfOfTheExposureIsTakenOff) {
  RealSenseStamps stamps;
  const auto at = [](double frame_ms, std::optional<std::int64_t> exposure_us) {
    return StatedTime{.sensor_us = {}, .frame_ms = frame_ms, .exposure_us = exposure_us};
  };
  EXPECT_FALSE(stamps.StampOf(StreamKind::kDepth, at(1000.0, 6000))) << "colour is not known yet";
  EXPECT_EQ(stamps.StampOf(StreamKind::kColor, at(1010.0, {})), 1'010'000);
  EXPECT_EQ(stamps.StampOf(StreamKind::kDepth, at(1033.0, 6000)), 1'030'000);
}

TEST(RealSenseStampsTest, BothStreamsUseTheClockThatBothHave) {
  RealSenseStamps stamps;
  const StatedTime with{.sensor_us = 5'000, .frame_ms = 2000.0, .exposure_us = 4000};
  const StatedTime without{.sensor_us = {}, .frame_ms = 2001.0, .exposure_us = {}};
  EXPECT_FALSE(stamps.StampOf(StreamKind::kDepth, with));
  EXPECT_EQ(stamps.StampOf(StreamKind::kColor, without), 2'001'000);
  EXPECT_EQ(stamps.StampOf(StreamKind::kDepth, with), 1'998'000);
}

TEST(RealSenseLibraryTest, TheNewestFileIsTaken) {
  const TempFolder folder;
  for (const char* name :
       {"librealsense2.so.2.54", "librealsense2.so.2.9.1", "librealsense2.so.2.100.1",
        "librealsense2.so.2.56.5", "librealsense2.so.3.1", "librealsense2.so.2.x",
        "librealsense2-gl.so.2.200"})
    WriteWholeFile(folder / name, std::string("x"));
  const std::string& prefix = RealSenseTitle().prefix;
  EXPECT_EQ(SdkLibrary::FindIn(prefix, {"/nowhere", folder.path()}),
            folder / "librealsense2.so.2.100.1");
  EXPECT_EQ(SdkLibrary::FindIn(prefix, {"/nowhere"}), "");
}

TEST_F(RealSenseTest, OtherLibrariesAreRefusedWithWhatIsExpected) {
  const auto refusal = [&] { return MessageOf<DeviceError>([&] { (void)Provider().List(); }); };
  fake::SetVersion(23506);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("2.35.6"), HasSubstr("2.36")));
  fake::SetVersion(30001);
  EXPECT_THAT(refusal(), HasSubstr("3.0.1"));
  settings_.library = "/usr/lib/nowhere/librealsense2.so.2.56";
  EXPECT_THAT(refusal(), AllOf(HasSubstr("nowhere"), HasSubstr("docs/realsense.md")));
  settings_.library = "libz.so.1";
  EXPECT_THAT(refusal(), HasSubstr("rs2_get_api_version"));
}

TEST_F(RealSenseTest, TheDoctorNamesLibraryAndCameras) {
  fake::FakeUnit unit = D435();
  unit.usb = "2.1";
  fake::Attach(unit);
  std::string text;
  bool has_bad = false;
  for (const SensorFinding& finding :
       BuiltInSensors().Choose("realsense", false).examine(settings_)) {
    text += finding.found.English() + " | " + finding.remedy.English() + "\n";
    has_bad = has_bad || finding.state == SensorFinding::State::kBad;
  }
  EXPECT_TRUE(has_bad);
  EXPECT_THAT(text, AllOf(HasSubstr("librealsense2 2.56.5"), HasSubstr(PLUMB_FAKE_REALSENSE),
                          HasSubstr("firmware 5.16.0.1"), HasSubstr("USB 3 port")));
}

}  // namespace
}  // namespace plumb
