// SPDX-License-Identifier: Apache-2.0
// The driver "freenect" on a fake library: what it sets and reads, plugging, stalls, and Kinects
// and libraries that it must refuse.
#include <opencv2/core.hpp>

#include "drivers/freenect/freenect_api.hpp"
#include "tests/devices/freenect/fake_freenect.hpp"
#include "tests/support/sdk_driver_cases.hpp"

namespace plumb {
namespace {

namespace fake = fake_freenect;
using testing::Refusal;

const std::string kSerial = fake::FakeKinect().serial;
constexpr std::uint32_t kPeriod_ticks = 2'000'000;  // 60 MHz.

struct FreenectMaker {
  static constexpr const char* kDriver = "freenect";
  static constexpr const char* kLibrary = PLUMB_FAKE_FREENECT;
  static constexpr int kToldOfUnplugging = 2;  // By its events and by the bus.
  static constexpr std::pair kSize{640, 480};
  static std::string Serial() { return kSerial; }
  static void AttachUsual() { fake::Attach({}); }
  static void Detach(const std::string& serial) { fake::Detach(serial); }
  static void Reset() { fake::Reset(); }
  static int NumAlive() { return fake::NumAlive(); }

  static void DeliverPair(std::int64_t number, std::uint32_t first_ticks = 6'000'000) {
    cv::Mat color(480, 640, CV_8UC3, cv::Scalar(10, 20, 30));
    cv::Mat depth(480, 640, CV_16UC1, cv::Scalar(750));
    const std::uint32_t at = first_ticks + static_cast<std::uint32_t>(number) * kPeriod_ticks;
    EXPECT_TRUE(fake::Deliver(kSerial, false, color.data, at));
    EXPECT_TRUE(fake::Deliver(kSerial, true, depth.data, at + 120'000));
  }

  static std::vector<Refusal> Refused() {
    return {{[] { fake::Attach({.has_registered = false}); },
             {kSerial, "no depth images", "docs/freenect.md"},
             ""},
            {[] { fake::Attach({.busy = true}); }, {kSerial, "end other programs"}, ""}};
  }
  static std::vector<Refusal> RefusedLibraries() {
    return {{{}, {"nowhere", "docs/freenect.md"}, "/usr/lib/nowhere/libfreenect.so.0.5"},
            {{}, {"freenect_init"}, "libz.so.1"}};
  }
  static void AttachForDoctor() { AttachUsual(); }
  static std::vector<std::string> DoctorNames() {
    return {"libfreenect 0.5", kLibrary, "Kinect " + kSerial};
  }
};

}  // namespace

namespace testing {
INSTANTIATE_TYPED_TEST_SUITE_P(Freenect, SdkDriverTest, FreenectMaker);
}  // namespace testing

namespace {

using FreenectTest = testing::SdkDriverTest<FreenectMaker>;

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
  const std::uint32_t first = 0U - 18 * kPeriod_ticks;  // After 71 s.
  fake::Attach({});
  const auto sensor = Open();
  double before_s = 0.0;
  for (int n = 1; n <= 20; ++n) FreenectMaker::DeliverPair(n, first);
  for (int i = 0; i < 4; ++i) {
    const std::optional<Frame> frame = sensor->Next();
    ASSERT_TRUE(frame);
    if (i > 0) {
      EXPECT_NEAR(frame->color_time_s - before_s, 1.0 / 30.0, 1e-5);
    }
    before_s = frame->color_time_s;
  }
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

}  // namespace
}  // namespace plumb
