// SPDX-License-Identifier: Apache-2.0
// What the doctor says of the calibration of attached units.
#include "daemon/cli/unit/doctor_sensor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "drivers/files/file_io.hpp"
#include "tests/support/fake_sensor.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class FakeSetup : public SensorSetup {
 public:
  explicit FakeSetup(testing::FakeBus& bus) : bus_(bus) {}
  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    return std::make_unique<testing::FakeProvider>(bus_);
  }

 private:
  testing::FakeBus& bus_;
};

class DoctorSensorTest : public ::testing::Test {
 protected:
  DoctorSensorTest() {
    bus_.Plug("S1");
    settings_.calibration_folder = folder_.path();
  }
  void WriteCalibration(int width, int height) {
    WriteWholeFile(folder_ / "S1.yaml",
                   fmt::format("image_width: {}\nimage_height: {}\n"
                               "camera_matrix: [612.5, 0, {}, 0, 612.5, {}, 0, 0, 1]\n"
                               "distortion_coefficients: [0, 0, 0, 0, 0]\n",
                               width, height, width / 2, height / 2));
  }
  /// Of a driver whose units state their camera, or of one whose units do not.
  DoctorReport Report(bool states_camera) {
    SensorDriver driver;
    driver.name = driver.title = "fake";
    driver.states_camera = states_camera;
    driver.set_up = [this](const SensorSettings&, const SimulatedSweeps&, const std::stop_token&,
                           const SetUpProgress&) { return std::make_unique<FakeSetup>(bus_); };
    DoctorReport report;
    CheckAttached(report, driver, settings_, "");
    return report;
  }
  std::string Text(bool states_camera) { return Report(states_camera).Text(EnglishCatalogue()); }

  testing::TempFolder folder_;
  testing::FakeBus bus_;
  SensorSettings settings_;
};

TEST_F(DoctorSensorTest, ACalibrationForImagesOfAnySizeIsGoodWhereTheSensorHasThem) {
  WriteCalibration(848, 480);
  EXPECT_TRUE(Report(true).ready());
  EXPECT_THAT(Text(true), AllOf(HasSubstr("848x480"), HasSubstr("612.5"), HasSubstr("S1.yaml")));
  EXPECT_FALSE(Report(false).ready());
  EXPECT_THAT(Text(false), HasSubstr("S1.yaml is for images of 848x480, expected 640x480"));
  WriteCalibration(1280, 960);
  EXPECT_TRUE(Report(false).ready()) << "a multiple";
}

TEST_F(DoctorSensorTest, WithoutAFileTheSensorsOwnCalibrationCounts) {
  EXPECT_THAT(Text(true), AllOf(HasSubstr("the factory's"), Not(HasSubstr("nominal"))));
  EXPECT_THAT(Text(false), AllOf(HasSubstr("nominal intrinsics"), HasSubstr("S1.yaml")));
}

TEST_F(DoctorSensorTest, ADamagedCalibrationIsBadForAnyDriver) {
  WriteWholeFile(folder_ / "S1.yaml", std::string("image_width: 848\n"));
  EXPECT_FALSE(Report(true).ready());
  EXPECT_FALSE(Report(false).ready());
  settings_.room_markers.length_m = 0.083;
  WriteCalibration(848, 480);
  WriteWholeFile(folder_ / "S1.yaml",
                 ReadTextFile(folder_ / "S1.yaml", 1000) + "marker_length: 0.104\n");
  EXPECT_THAT(Text(true), HasSubstr("this room has 0.083 m"));
}

}  // namespace
}  // namespace plumb
