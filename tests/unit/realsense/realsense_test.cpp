// SPDX-License-Identifier: Apache-2.0
// The driver "realsense" on a fake library: what it sets and reads, plugging, stalls, and cameras
// and libraries that it must refuse.
#include <cmath>
#include <map>

#include <opencv2/core.hpp>

#include "drivers/realsense/realsense_library.hpp"
#include "drivers/realsense/realsense_stamps.hpp"
#include "tests/devices/realsense/fake_realsense.hpp"
#include "tests/support/sdk_driver_cases.hpp"

namespace plumb {
namespace {

namespace fake = fake_realsense;
using namespace realsense;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::Refusal;
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

/// A D435 with something changed.
template <typename Change>
void AttachD435(Change&& change) {
  fake::FakeUnit unit = D435();
  change(unit);
  fake::Attach(std::move(unit));
}

struct RealSenseMaker {
  static constexpr const char* kDriver = "realsense";
  static constexpr const char* kLibrary = PLUMB_FAKE_REALSENSE;
  static constexpr int kToldOfUnplugging = 1;
  static constexpr std::pair kSize{640, 360};
  static std::string Serial() { return kSerial; }
  static void AttachUsual() { fake::Attach(D435()); }
  static void Detach(const std::string& serial) { fake::Detach(serial); }
  static void Reset() { fake::Reset(); }
  static int NumAlive() { return fake::NumAlive(); }

  static void Deliver(const cv::Mat& image, std::int64_t number, std::int64_t at_us) {
    const bool is_color = image.type() == CV_8UC3;
    EXPECT_TRUE(fake::Deliver(
        kSerial, {.stream = is_color ? kStreamColor : kStreamDepth,
                  .format = is_color ? kFormatRgb8 : kFormatZ16,
                  .width = image.cols,
                  .height = image.rows,
                  .stride = static_cast<int>(image.step),
                  .data = image.data,
                  .number = static_cast<std::uint64_t>(number),
                  .metadata = {{kMetadataSensorTimestamp, at_us % (std::int64_t{1} << 32)}}}));
  }
  static void DeliverPair(std::int64_t number, cv::Size color = {1280, 720},
                          cv::Size depth = {848, 480}, std::int64_t first_us = 1'000'000) {
    const std::int64_t at_us = first_us + number * kPeriod_us;
    Deliver(cv::Mat(color, CV_8UC3, cv::Scalar(10, 20, 30)), number, at_us);
    Deliver(cv::Mat(depth, CV_16UC1, cv::Scalar(2000)), number, at_us + 4000);
  }

  static std::vector<Refusal> Refused() {
    const auto with = [](void (*change)(fake::FakeUnit&), std::vector<std::string> named) {
      return Refusal{[=] { AttachD435(change); }, std::move(named), ""};
    };
    return {with([](auto& unit) { unit.usb = "2.1"; }, {kSerial, "USB 2.1", "USB 3 port"}),
            with([](auto& unit) { unit.firmware = "5.9.2.100"; },
                 {"5.9.2.100", "5.9.3.0", "rs-fw-update"}),
            with([](auto& unit) { unit.depth_modes = {Depth(256, 144)}; },
                 {kSerial, "no depth images"}),
            with([](auto& unit) { unit.busy = true; }, {kSerial, "busy"}),
            with(
                [](auto& unit) {
                  for (fake::FakeMode& mode : unit.color_modes) mode.camera.fx = std::nanf("");
                },
                {kSerial, "calibration"}),
            with(
                [](auto& unit) {
                  unit.color_modes[0].camera.model = 3;  // F-theta.
                  unit.color_modes[0].camera.coefficients[0] = 0.1F;
                },
                {"model 3"}),
            with([](auto& unit) { unit.depth_unit_m = 0.0F; }, {"calibration of its factory"})};
  }
  static std::vector<Refusal> RefusedLibraries() {
    return {{[] { fake::SetVersion(23506); }, {"2.35.6", "2.36"}, ""},
            {[] { fake::SetVersion(30001); }, {"3.0.1"}, ""},
            {{}, {"nowhere", "docs/realsense.md"}, "/usr/lib/nowhere/librealsense2.so.2.56"},
            {{}, {"rs2_get_api_version"}, "libz.so.1"}};
  }
  static void AttachForDoctor() {
    AttachD435([](auto& unit) { unit.usb = "2.1"; });
  }
  static std::vector<std::string> DoctorNames() {
    return {"librealsense2 2.56.5", kLibrary, "firmware 5.16.0.1", "USB 3 port"};
  }
};

}  // namespace

namespace testing {
INSTANTIATE_TYPED_TEST_SUITE_P(RealSense, SdkDriverTest, RealSenseMaker);
}  // namespace testing

namespace {

using RealSenseTest = testing::SdkDriverTest<RealSenseMaker>;

TEST_F(RealSenseTest, DepthComesInItsOwnCameraAndColourHalved) {
  AttachD435([](auto& unit) { unit.depth_unit_m = 0.0005F; });
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
  DeliverPairs();
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
  AttachD435([](auto& d405) {
    d405.color_modes.clear();
    d405.depth_modes = {Depth(848, 480), Color(848, 480)};
  });
  settings_.exposure_us = 8000;
  const auto sensor = Open();
  for (int n = 1; n <= 20; ++n) RealSenseMaker::DeliverPair(n, {848, 480});
  EXPECT_TRUE(sensor->Next());
  sensor->LockExposure(true);
  EXPECT_EQ(fake::OptionOf(kSerial, kStreamColor, kOptionExposure), 8000.0F) << "1 us each";
}

TEST_F(RealSenseTest, AnotherUnitThatIsUnpluggedDoesNotMatter) {
  fake::Attach(D435());
  AttachD435([](auto& other) { other.serial = "900000000001"; });
  EXPECT_EQ(Provider().List().size(), 2U);
  const auto sensor = Open();
  EXPECT_EQ(sensor->description().serial, kSerial);
  fake::Detach("900000000001");
  DeliverPairs();
  EXPECT_TRUE(sensor->Next());
}

TEST_F(RealSenseTest, ImagesOfAnotherSizeAreAFaultThatNamesBoth) {
  fake::Attach(D435());
  const auto sensor = Open();
  RealSenseMaker::DeliverPair(1, {1280, 720}, {640, 480});
  ExpectNamed(WhyNotNext(*sensor), {kSerial, "depth", "640x480", "expected 848x480"});
}

TEST_F(RealSenseTest, FirmwareIsComparedNumberByNumber) {
  AttachD435([](auto& unit) { unit.firmware = "5.12.7.100"; });
  const auto sensor = Open();
  ASSERT_EQ(sensor->info().warnings.size(), 1U);
  EXPECT_THAT(sensor->info().warnings[0].English(),
              AllOf(HasSubstr("5.12.7.100"), HasSubstr("5.16.0.1")));
}

TEST_F(RealSenseTest, StampsPassTheEndOfTheCamerasCounter) {
  const std::int64_t first_us = (std::int64_t{1} << 32) - 25 * kPeriod_us;
  fake::Attach(D435());
  const auto sensor = Open();
  const auto deliver = [&] {
    RealSenseMaker::DeliverPair(++number_, {1280, 720}, {848, 480}, first_us);
  };
  for (int i = 0; i < 20; ++i) deliver();
  double before_s = sensor->Next()->depth_time_s;
  for (int i = 0; i < 10; ++i) {
    deliver();
    while (const std::optional<Frame> frame = sensor->Next()) {
      EXPECT_NEAR(frame->depth_time_s - before_s, 1e-6 * kPeriod_us, 1e-6);
      before_s = frame->depth_time_s;
      if (frame->depth_time_s > 1e-6 * static_cast<double>(first_us + number_ * kPeriod_us)) break;
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

TEST(RealSenseStampsTest, ClocksThatDifferAreNamedAndNotMixed) {
  const StatedTime by_camera{.sensor_us = 5'000, .frame_ms = 5.0, .exposure_us = {}};
  const StatedTime by_computer{
      .sensor_us = {}, .frame_ms = 1.7e12, .frame_is_by_camera = false, .exposure_us = {}};
  RealSenseStamps stamps;
  EXPECT_FALSE(stamps.StampOf(StreamKind::kColor, by_camera));
  EXPECT_EQ(stamps.LacksClock(), std::nullopt) << "depth is not known yet";
  EXPECT_FALSE(stamps.StampOf(StreamKind::kDepth, by_computer));
  EXPECT_EQ(stamps.LacksClock(), StreamKind::kDepth);
  EXPECT_FALSE(stamps.StampOf(StreamKind::kColor, by_camera));
  RealSenseStamps both;  // One clock, if not the camera's.
  EXPECT_FALSE(both.StampOf(StreamKind::kColor, by_computer));
  EXPECT_TRUE(both.StampOf(StreamKind::kDepth, by_computer));
  EXPECT_EQ(both.LacksClock(), std::nullopt);
}

TEST_F(RealSenseTest, MetadataOfOneStreamOnlyIsNamedAtOnce) {
  fake::Attach(D435());
  const auto sensor = Open();
  const cv::Mat color(720, 1280, CV_8UC3, cv::Scalar(10, 20, 30));
  RealSenseMaker::Deliver(color, 1, 1'000'000);
  const cv::Mat depth(480, 848, CV_16UC1, cv::Scalar(2000));
  EXPECT_TRUE(fake::Deliver(kSerial, {.stream = kStreamDepth,
                                      .format = kFormatZ16,
                                      .width = depth.cols,
                                      .height = depth.rows,
                                      .stride = static_cast<int>(depth.step),
                                      .data = depth.data,
                                      .number = 1,
                                      .timestamp_ms = 1.7e12,
                                      .timestamp_domain = kDomainSystemTime,
                                      .metadata = {}}));
  ExpectNamed(WhyNotNext(*sensor),
              {kSerial, "depth images", "metadata of the kernel", "docs/realsense.md"});
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

}  // namespace
}  // namespace plumb
