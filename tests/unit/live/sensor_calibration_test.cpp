// SPDX-License-Identifier: Apache-2.0
// Which markers hold for a live sensor: the room's.
#include "drivers/live/sensor_calibration.hpp"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MessageOf;

class SensorCalibrationTest : public ::testing::Test {
 protected:
  SensorCalibrationTest() {
    room_.calibration_folder = folder_.path();
    room_.room_markers.dictionary = "DICT_4X4_50";
    room_.room_markers.length_m = 0.083;
    room_.room_markers.reference = 7;
  }
  void Write(const std::string& keys) const {
    std::ofstream(folder_ / "S1.yaml") << "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
                                          "camera_matrix: [525, 0, 319.5, 0, 525, 239.5, 0, 0, 1]\n"
                                          "distortion_coefficients: [0, 0, 0, 0, 0]\n"
                                       << keys;
  }
  [[nodiscard]] StreamInfo Info() const { return LiveStreamInfo(room_, "S1", 640, 480, 0.0); }
  [[nodiscard]] std::string Complaint(const std::string& keys) const {
    Write(keys);
    return MessageOf<DeviceError>([&] { (void)Info(); });
  }

  testing::TempFolder folder_;
  SensorSettings room_;
};

TEST_F(SensorCalibrationTest, TheMarkersAreTheRoomsWhateverTheFileLeavesOut) {
  Write("");
  const StreamInfo info = Info();
  EXPECT_EQ(info.room_markers.dictionary, "DICT_4X4_50");
  EXPECT_EQ(info.room_markers.length_m, 0.083);
  EXPECT_EQ(info.room_markers.reference, 7);
  EXPECT_FALSE(info.intrinsics_assumed);
}

TEST_F(SensorCalibrationTest, AFileThatSaysTheSameIsTaken) {
  Write("marker_dictionary: DICT_4X4_50\nmarker_length: 0.083\nreference_marker: 7\n");
  EXPECT_EQ(Info().room_markers.length_m, 0.083);
  EXPECT_EQ(Info().room_markers.reference, 7);
}

TEST_F(SensorCalibrationTest, AFileWithOtherMarkersThanTheRoomIsRefused) {
  EXPECT_THAT(Complaint("marker_length: 0.104\n"),
              AllOf(HasSubstr("S1.yaml"), HasSubstr("marker_length"), HasSubstr("0.104"),
                    HasSubstr("0.083"), HasSubstr("markers.length_m")));
  EXPECT_THAT(Complaint("marker_length: 0.0831\n"), HasSubstr("0.0831"));
  EXPECT_THAT(Complaint("marker_dictionary: DICT_6X6_250\n"),
              AllOf(HasSubstr("DICT_6X6_250"), HasSubstr("DICT_4X4_50")));
  EXPECT_THAT(Complaint("reference_marker: 8\n"),
              AllOf(HasSubstr("reference_marker is 8"), HasSubstr("this room has 7")));
  room_.room_markers.reference.reset();
  EXPECT_THAT(Complaint("reference_marker: 7\n"), HasSubstr("none configured"));
}

TEST_F(SensorCalibrationTest, TheMarkersAreTheRoomsUnlessADriverSaysOtherwise) {
  Write("marker_length: 0.104\n");
  SensorSettings settings{.calibration_folder = folder_.path()};
  settings.room_markers.length_m = 0.083;
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)LiveStreamInfo(settings, "S1", 640, 480, 0.0); }),
              HasSubstr("this room has 0.083 m"));
  settings.markers_are_the_rooms = false;
  EXPECT_EQ(LiveStreamInfo(settings, "S1", 640, 480, 0.0).room_markers.length_m, 0.104);
}

TEST_F(SensorCalibrationTest, WithoutARoomTheFileSaysWhichMarkersThereAre) {
  room_.markers_are_the_rooms = false;
  Write("marker_dictionary: DICT_6X6_250\nmarker_length: 0.104\nreference_marker: 8\n");
  const StreamInfo info = Info();
  EXPECT_EQ(info.room_markers.dictionary, "DICT_6X6_250");
  EXPECT_EQ(info.room_markers.length_m, 0.104);
  EXPECT_EQ(info.room_markers.reference, 8);
}

TEST_F(SensorCalibrationTest, TheDepthNoiseIsTheDriversUnlessTheUnitsFileStatesOne) {
  const DepthNoise of_model = {.constant_m = 0.003, .quadratic_m_per_m2 = 0.0};
  const auto noise = [&] {
    return LiveStreamInfo(room_, "S1", 640, 480, 0.0, {.noise = of_model}).depth_noise;
  };
  EXPECT_EQ(noise(), of_model) << "without a file";
  EXPECT_EQ(Info().depth_noise, DepthNoise()) << "of a driver that states none";
  Write("");
  EXPECT_EQ(noise(), of_model);
  Write(
      "depth_noise: {constant_m: 0.002, linear_m_per_m: 0, quadratic_m_per_m2: 0.001, "
      "origin_m: 0, grazing_m: 0}\n");
  const DepthNoise of_unit = {
      .constant_m = 0.002, .quadratic_m_per_m2 = 0.001, .origin_m = 0.0, .grazing_m = 0.0};
  EXPECT_EQ(noise(), of_unit);
  EXPECT_THAT(Complaint("depth_noise: {constant_m: 2}\n"),
              AllOf(HasSubstr("S1.yaml: depth_noise"), HasSubstr("correct or remove the file")));
}

TEST_F(SensorCalibrationTest, TheClassIsTheDriversUnlessTheUnitsFileStatesAnother) {
  KnownDepth known = KnownOfClass(DepthSensor::kTimeOfFlight);
  known.noise.constant_m = 0.003;
  known.range = {.nearest_m = 0.5, .farthest_m = 5.0};
  const auto info = [&] { return LiveStreamInfo(room_, "S1", 640, 480, 0.0, known); };
  const auto expect_known = [&](const char* when) {
    EXPECT_EQ(info().depth_sensor, DepthSensor::kTimeOfFlight) << when;
    EXPECT_EQ(info().depth_noise, known.noise) << when;
    EXPECT_EQ(info().usable_depth, known.range) << when;
  };
  expect_known("no file");
  Write("");
  expect_known("a file that states nothing of depth");
  Write("depth_sensor: time_of_flight\n");
  expect_known("a file that repeats the class");
  Write("depth_range: [0.3, 4.0]\n");
  EXPECT_EQ(info().depth_sensor, DepthSensor::kTimeOfFlight);
  EXPECT_EQ(info().usable_depth, UsableDepth()) << "stated, though it is a default";
  Write("depth_sensor: lidar\n");
  EXPECT_EQ(info().depth_sensor, DepthSensor::kLidar);
  EXPECT_EQ(info().depth_noise, ClassOf(DepthSensor::kLidar).noise);
  EXPECT_EQ(info().usable_depth, ClassOf(DepthSensor::kLidar).range);
}

}  // namespace
}  // namespace plumb
