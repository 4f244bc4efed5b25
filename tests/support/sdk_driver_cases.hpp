// SPDX-License-Identifier: Apache-2.0
// What is true of each driver that loads a maker's library, on the fake library: plugging, stalls,
// the unit's own calibration, what it refuses, and what the doctor says of it. A driver's test
// gives a type `Maker` that says what its camera and its library are, and adds what is its own.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb::testing {

/// Something that is refused, and what its refusal has to name.
struct Refusal {
  std::function<void()> set_up;
  std::vector<std::string> named;
  std::string library;  ///< Another than the fake one.
};

/// @tparam Maker  With `kDriver`, `kLibrary`, `kToldOfUnplugging` (times), `Serial()`,
/// `AttachUsual()`, `Detach()`, `Reset()`, `NumAlive()`, `DeliverPair(number)` of the usual
/// camera's sizes, and for the cases `kSize`, `Refused()`, `RefusedLibraries()`,
/// `AttachForDoctor()` and `DoctorNames()`.
template <typename Maker>
class SdkDriverTest : public ::testing::Test {
 protected:
  SdkDriverTest() {
    Maker::Reset();
    settings_.calibration_folder = folder_ / "calibration";
    settings_.library = Maker::kLibrary;
  }
  ~SdkDriverTest() override {
    provider_.reset();
    EXPECT_EQ(Maker::NumAlive(), 0) << "what the library gives out is given back";
    Maker::Reset();
  }

  SensorProvider& Provider() {
    if (!provider_) {
      setup_ = BuiltInSensors().Choose(Maker::kDriver, false).set_up(settings_, {}, {}, {});
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
    return changed_.wait_for(lock, std::chrono::seconds(20), [&] { return num_changes_ >= count; });
  }
  /// As many pairs as are left out while the exposure settles, and one that is not.
  void DeliverPairs() {
    for (int i = 0; i < 20; ++i) Maker::DeliverPair(++number_);
  }
  std::string WhyNotOpen() {
    return MessageOf<DeviceError>([&] { (void)Open(); });
  }
  static std::string WhyNotNext(LiveSensor& sensor) {
    return MessageOf<DeviceError>([&] { (void)sensor.Next(); });
  }
  static void ExpectNamed(const std::string& text, const std::vector<std::string>& named) {
    for (const std::string& part : named) EXPECT_THAT(text, ::testing::HasSubstr(part));
  }

  const TempFolder folder_;
  SensorSettings settings_;
  std::unique_ptr<SensorSetup> setup_;
  std::unique_ptr<SensorProvider> provider_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int num_changes_ = 0;
  std::int64_t number_ = 0;
};

TYPED_TEST_SUITE_P(SdkDriverTest);

TYPED_TEST_P(SdkDriverTest, UnpluggingEndsTheSensorAndItComesBack) {
  TypeParam::AttachUsual();
  auto sensor = this->Open();
  const std::string uri = sensor->description().uri;
  this->DeliverPairs();
  EXPECT_TRUE(sensor->Next());
  TypeParam::Detach(TypeParam::Serial());
  EXPECT_THAT(MessageOf<DeviceLost>([&] {
                while (sensor->Next()) continue;
              }),
              ::testing::HasSubstr("was unplugged"));
  sensor.reset();
  ASSERT_TRUE(this->AwaitChanges(TypeParam::kToldOfUnplugging));
  EXPECT_THAT(this->WhyNotOpen(), ::testing::HasSubstr("no sensor is attached"));
  TypeParam::AttachUsual();
  ASSERT_TRUE(this->AwaitChanges(TypeParam::kToldOfUnplugging + 1));
  sensor = this->Open();
  EXPECT_NE(sensor->description().uri, uri);
  this->DeliverPairs();
  EXPECT_TRUE(sensor->Next());
}

TYPED_TEST_P(SdkDriverTest, AStallIsToldWithWhatCame) {
  TypeParam::AttachUsual();
  const auto sensor = this->Open();
  this->ExpectNamed(this->WhyNotNext(*sensor),
                    {TypeParam::Serial(), "no pair of images for 3000 ms"});
}

TYPED_TEST_P(SdkDriverTest, TheUnitsOwnCalibrationTakesPrecedence) {
  TypeParam::AttachUsual();
  const auto usual = this->Open()->info();
  const auto [width, height] = TypeParam::kSize;
  std::filesystem::create_directories(this->folder_ / "calibration");
  WriteWholeFile(this->folder_ / "calibration" / (TypeParam::Serial() + ".yaml"),
                 fmt::format("%YAML:1.0\nimage_width: {}\nimage_height: {}\n"
                             "camera_matrix: [471., 0., {}., 0., 470., {}., 0., 0., 1.]\n"
                             "distortion_coefficients: [0.05, -0.1, 0., 0., 0.]\n",
                             width, height, width / 2, height / 2));
  auto sensor = this->Open();
  EXPECT_EQ(sensor->info().intrinsics.fx, 471.0);
  EXPECT_EQ(sensor->info().intrinsics.distortion[0], 0.05);
  EXPECT_FALSE(sensor->info().intrinsics_assumed);
  EXPECT_EQ(sensor->info().depth_sensor, usual.depth_sensor);
  EXPECT_EQ(sensor->info().depth_noise, usual.depth_noise);
  EXPECT_EQ(sensor->info().usable_depth, usual.usable_depth);
  const std::filesystem::path file =
      this->folder_ / "calibration" / (TypeParam::Serial() + ".yaml");
  const std::string text = ReadTextFile(file, 10'000);
  WriteWholeFile(file, text + "depth_sensor: lidar\ndepth_range: [0.3, 4.0]\n");
  sensor.reset();
  const auto other = this->Open();
  EXPECT_EQ(other->info().depth_sensor, DepthSensor::kLidar);
  EXPECT_EQ(other->info().depth_noise, ClassOf(DepthSensor::kLidar).noise);
  EXPECT_EQ(other->info().usable_depth, UsableDepth()) << "stated, though it is a default";
}

TYPED_TEST_P(SdkDriverTest, WhatCannotBeUsedIsRefusedWithTheReason) {
  for (const Refusal& refused : TypeParam::Refused()) {
    TypeParam::Reset();
    this->provider_.reset();
    refused.set_up();
    this->ExpectNamed(this->WhyNotOpen(), refused.named);
  }
}

TYPED_TEST_P(SdkDriverTest, OtherLibrariesAreRefusedWithWhatIsExpected) {
  for (const Refusal& refused : TypeParam::RefusedLibraries()) {
    if (refused.set_up) refused.set_up();
    if (!refused.library.empty()) this->settings_.library = refused.library;
    this->provider_.reset();
    this->ExpectNamed(MessageOf<DeviceError>([&] { (void)this->Provider().List(); }),
                      refused.named);
  }
}

TYPED_TEST_P(SdkDriverTest, TheDoctorNamesLibraryAndCameras) {
  TypeParam::AttachForDoctor();
  std::string text;
  bool has_bad = false;
  for (const SensorFinding& finding :
       BuiltInSensors().Choose(TypeParam::kDriver, false).examine(this->settings_)) {
    text += finding.found.English() + " | " + finding.remedy.English() + "\n";
    has_bad = has_bad || finding.state == SensorFinding::State::kBad;
  }
  EXPECT_EQ(has_bad, text.find("USB 3 port") != std::string::npos);
  TypeParam::Reset();
  TypeParam::AttachUsual();
  EXPECT_EQ(this->Open()->info().intrinsics_assumed,
            !BuiltInSensors().Choose(TypeParam::kDriver, false).states_camera)
      << "what the doctor says of a unit without a calibration file";
  this->ExpectNamed(text, TypeParam::DoctorNames());
}

REGISTER_TYPED_TEST_SUITE_P(SdkDriverTest, UnpluggingEndsTheSensorAndItComesBack,
                            AStallIsToldWithWhatCame, TheUnitsOwnCalibrationTakesPrecedence,
                            WhatCannotBeUsedIsRefusedWithTheReason,
                            OtherLibrariesAreRefusedWithWhatIsExpected,
                            TheDoctorNamesLibraryAndCameras);

}  // namespace plumb::testing
