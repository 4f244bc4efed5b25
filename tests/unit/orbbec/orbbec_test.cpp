// SPDX-License-Identifier: Apache-2.0
// The driver "orbbec" on a fake library: what it sets and reads, plugging, stalls, and cameras and
// libraries that it must refuse.
#include <cmath>

#include <opencv2/core.hpp>

#include "tests/devices/orbbec/fake_orbbec.hpp"
#include "tests/support/sdk_driver_cases.hpp"

namespace plumb {
namespace {

namespace fake = fake_orbbec;
using namespace orbbec;
using ::testing::HasSubstr;
using testing::Refusal;

const std::string kSerial = fake::FakeCamera().serial;
constexpr std::int64_t kPeriod_us = 33'333;

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

/// A Gemini with something changed.
template <typename Change>
void AttachGemini(Change&& change) {
  fake::FakeCamera camera = Gemini();
  change(camera);
  fake::Attach(std::move(camera));
}

struct OrbbecMaker {
  static constexpr const char* kDriver = "orbbec";
  static constexpr const char* kLibrary = PLUMB_FAKE_ORBBEC;
  static constexpr int kToldOfUnplugging = 1;
  static constexpr std::pair kSize{640, 360};
  static std::string Serial() { return kSerial; }
  static void AttachUsual() { fake::Attach(Gemini()); }
  static void Detach(const std::string& serial) { fake::Detach(serial); }
  static void Reset() { fake::Reset(); }
  static int NumAlive() { return fake::NumAlive(); }

  static void Deliver(const cv::Mat& image, std::int64_t number, std::int64_t at_us,
                      float scale_mm) {
    const bool is_depth = image.type() == CV_16UC1;
    EXPECT_TRUE(fake::Deliver(
        kSerial, {.is_depth = is_depth,
                  .format = is_depth ? kFormatY16 : kFormatRgb,
                  .width = static_cast<std::uint32_t>(image.cols),
                  .height = static_cast<std::uint32_t>(image.rows),
                  .bytes = static_cast<std::uint32_t>(image.total() * image.elemSize()),
                  .data = image.data,
                  .number = static_cast<std::uint64_t>(number),
                  .stamp_us = static_cast<std::uint64_t>(at_us),
                  .scale_mm = scale_mm}));
  }
  static void DeliverPair(std::int64_t number, cv::Size depth = {848, 480}, int value = 1000,
                          float scale_mm = 1.0F) {
    const std::int64_t at_us = 5'000'000 + number * kPeriod_us;
    Deliver(cv::Mat(720, 1280, CV_8UC3, cv::Scalar(10, 20, 30)), number, at_us, 0.0F);
    Deliver(cv::Mat(depth, CV_16UC1, cv::Scalar(value)), number, at_us + 4000, scale_mm);
  }

  static std::vector<Refusal> Refused() {
    const auto with = [](void (*change)(fake::FakeCamera&), std::vector<std::string> named) {
      return Refusal{[=] { AttachGemini(change); }, std::move(named), ""};
    };
    return {
        with([](auto& camera) { camera.port = "USB2.1"; }, {kSerial, "USB 2.1", "USB 3 port"}),
        with([](auto& camera) { camera.firmware = "1.2.9"; }, {"1.2.9", "1.2.20", "OrbbecViewer"}),
        with([](auto& camera) { camera.color_modes = {Mode(5, 1280, 720, 0.75F)}; },
             {kSerial, "no colour images", "docs/orbbec.md"}),
        with([](auto& camera) { camera.busy = true; }, {kSerial, "busy"}),
        with([](auto& camera) { camera.color_modes[0].camera.fx = std::nanf(""); },
             {kSerial, "calibration"}),
        with(
            [](auto& camera) {
              camera.depth_modes[2].lens = {.k1 = 0.1F, .model = kDistortionKannalaBrandt};
            },
            {"model 5"})};
  }
  static std::vector<Refusal> RefusedLibraries() {
    return {{[] { fake::SetVersion(11005); }, {"1.10.5", "2.0"}, ""},
            {{}, {"nowhere", "docs/orbbec.md"}, "/usr/lib/nowhere/libOrbbecSDK.so.2.8"}};
  }
  static void AttachForDoctor() {
    AttachGemini([](auto& camera) { camera.port = "USB2.1"; });
  }
  static std::vector<std::string> DoctorNames() {
    return {"OrbbecSDK 2.8.7", kLibrary, "firmware 1.8.10", "USB 3 port"};
  }
};

}  // namespace

namespace testing {
INSTANTIATE_TYPED_TEST_SUITE_P(Orbbec, SdkDriverTest, OrbbecMaker);
}  // namespace testing

namespace {

using OrbbecTest = testing::SdkDriverTest<OrbbecMaker>;

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
  DeliverPairs();
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
  while (number_ < 20) OrbbecMaker::DeliverPair(++number_, {848, 480}, 10'000, 0.1F);
  std::optional<Frame> frame = sensor->Next();
  ASSERT_TRUE(frame);
  EXPECT_FLOAT_EQ(frame->depth_m.at<float>(180, 320), 1.0F);
  OrbbecMaker::DeliverPair(++number_, {848, 480}, 7000,
                           1.0F);  // What 16 bits do not hold is left out.
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
  for (int n = 1; n <= 20; ++n) OrbbecMaker::DeliverPair(n, {640, 576});
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

TEST_F(OrbbecTest, AnOpenCameraIsStillListedWithItsFirmware) {
  fake::Attach(Gemini());
  const auto sensor = Open();
  EXPECT_EQ(Provider().List().size(), 1U) << "the library does not open it twice";
}

TEST_F(OrbbecTest, ImagesOfAnotherSizeAreAFaultThatNamesBoth) {
  fake::Attach(Gemini());
  const auto sensor = Open();
  OrbbecMaker::DeliverPair(1, {640, 480});
  ExpectNamed(WhyNotNext(*sensor), {"depth", "640x480", "expected 848x480"});
}

}  // namespace
}  // namespace plumb
