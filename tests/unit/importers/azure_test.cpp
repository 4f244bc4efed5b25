// SPDX-License-Identifier: Apache-2.0
// Recordings of k4arecorder, from a writer of the test's own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/importers/import.hpp"
#include "drivers/importers/open_recorded_file.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/importers/mkv_writer.hpp"
#include "tests/unit/importers/read_from_memory.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using testing::AzureTruth;
using ::testing::HasSubstr;
using testing::InMemory;
using testing::IsRefused;
using testing::MessageOf;
using testing::MkvWriter;
using testing::TempFolder;

constexpr int kFrames = 3;

AzureTruth Truth() {
  AzureTruth truth;
  for (int i = 0; i < kFrames; ++i) {
    const auto jpeg = EncodeJpeg(cv::Mat(720, 1280, CV_8UC3, cv::Scalar(200, 20 * i, 10)), 90);
    truth.colors.emplace_back(jpeg.begin(), jpeg.end());
    std::string depth;
    for (int k = 0; k < 320 * 288; ++k) {  // The high byte first.
      depth += static_cast<char>((900 + i) >> 8);
      depth += static_cast<char>((900 + i) & 0xff);
    }
    truth.depths.push_back(depth);
  }
  return truth;
}

TEST(AzureTest, BothCamerasAndTheClassComeFromTheFile) {
  const TempFolder folder;
  WriteWholeFile(folder / "sweep.mkv", MkvWriter::Write(Truth()));
  ASSERT_TRUE(IsImportable(folder / "sweep.mkv"));
  const auto recording = OpenImported(folder / "sweep.mkv");
  EXPECT_EQ(recording->facts().serial, "000123400412");
  EXPECT_EQ(recording->facts().firmware, "1.6.75");
  EXPECT_EQ(recording->info().depth_sensor, DepthSensor::kTimeOfFlight);
  const Intrinsics& color = recording->info().intrinsics;
  EXPECT_EQ(color.width, 1280);
  // Of 1280 x 960 pixels, 720 rows are delivered, from the 121st on.
  EXPECT_NEAR(color.fx, 0.4709 * 1280, 1e-9);
  EXPECT_NEAR(color.fy, 0.6274 * 960, 1e-9);
  EXPECT_NEAR(color.cx, 0.4968 * 1280 - 0.5, 1e-9);
  EXPECT_NEAR(color.cy, 0.5109 * 960 - 120.5, 1e-9);
  EXPECT_EQ(color.distortion, (std::array<double, 8>{0.7227, -2.8856, 0.000783, -0.000143, 1.6327,
                                                     0.6022, -2.7196, 1.5651}));
  const DepthCamera& depth = recording->facts().camera.depth_camera.value();
  EXPECT_NEAR(depth.intrinsics.fx, 0.4921 * 512, 1e-9);
  EXPECT_NEAR(depth.intrinsics.cx, 0.51 * 512 - 96.5, 1e-9);
  EXPECT_NEAR(depth.intrinsics.cy, 0.49 * 512 - 90.5, 1e-9);
  EXPECT_TRUE(depth.T_color_depth.translation().isApprox(Eigen::Vector3d(-0.032, -0.002, 0.004)));
}

TEST(AzureTest, FramesComeBackWithStampsOfTheDevice) {
  for (const bool groups : {false, true}) {
    AzureTruth truth = Truth();
    truth.groups = groups;
    truth.known_sizes = !groups;
    const TempFolder folder;
    WriteWholeFile(folder / "sweep.mkv", MkvWriter::Write(truth));
    const auto recording = OpenImported(folder / "sweep.mkv");
    EXPECT_EQ(recording->info().num_frames, kFrames);
    for (int i = 0; i < kFrames; ++i) {
      const Frame frame = recording->Next().value();
      EXPECT_NEAR(frame.color_time_s, 1.00025 + 0.033333 * i, 1e-6);
      EXPECT_NEAR(frame.depth_time_s, 0.99965 + 0.033333 * i, 1e-6);
      EXPECT_NEAR(frame.color_rgb.at<cv::Vec3b>(300, 600)[0], 200, 6);
      EXPECT_NEAR(frame.depth_m.at<float>(360, 640), 0.904 + 1e-3 * i, 1e-4);
    }
  }
}

TEST(AzureTest, ColourThatIsNotJpegIsConverted) {
  AzureTruth truth = Truth();
  // Grey of 128: brightness 128, no colour.
  for (const auto& [packing, bytes] :
       {std::pair{"NV12", 1280 * 720 / 2 * 3}, {"YUY2", 1280 * 720 * 2}}) {
    truth.color_packing = packing;
    truth.colors.assign(1, std::string(static_cast<std::size_t>(bytes), '\x80'));
    const std::vector<std::uint8_t> file = MkvWriter::Write(truth);
    const cv::Mat color = OpenRecordedFile(InMemory(file))->Color(0);
    EXPECT_EQ(color.size(), cv::Size(1280, 720));
    const cv::Vec3b pixel = color.at<cv::Vec3b>(100, 100);
    EXPECT_NEAR(pixel[0], 130, 2) << packing;
    EXPECT_EQ(pixel[0], pixel[2]) << packing;
    truth.colors[0].pop_back();
    const std::vector<std::uint8_t> shorter = MkvWriter::Write(truth);
    EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenRecordedFile(InMemory(shorter))->Color(0); }),
                HasSubstr("1280x720"));
  }
}

TEST(AzureTest, WhatIsMissingIsNamed) {
  const auto refusal = [](const AzureTruth& truth, std::size_t cut = 0) {
    std::vector<std::uint8_t> file = MkvWriter::Write(truth);
    file.resize(file.size() - cut);
    return MessageOf<DataError>([&] { (void)OpenRecordedFile(InMemory(file)); });
  };
  AzureTruth truth = Truth();
  EXPECT_THAT(refusal(truth, 1000), AllOf(HasSubstr("cut off at byte"), HasSubstr("mkvmerge")));
  truth.calibration.clear();
  EXPECT_THAT(refusal(truth), HasSubstr("calibration.json"));
  truth = Truth();
  truth.depth_width = 640;
  EXPECT_THAT(refusal(truth), HasSubstr("640x288"));
  truth = Truth();
  truth.color_packing = "H264";
  EXPECT_THAT(refusal(truth), AllOf(HasSubstr("H264"), HasSubstr("MJPG")));
}

TEST(AzureTest, FiveHundredDamagedFilesAreReadOrRefused) {
  std::mt19937 random(31);
  AzureTruth truth = Truth();
  truth.depths.resize(1);
  const std::vector<std::uint8_t> good = MkvWriter::Write(truth);
  int num_refused = 0;
  for (int i = 0; i < 500; ++i) {
    std::vector<std::uint8_t> bytes = good;
    for (int change = 0; change < 1 + i % 4; ++change)
      bytes[random() % (i % 4 != 0 ? 2500 : bytes.size())] = static_cast<std::uint8_t>(random());
    if (i % 5 == 0) bytes.resize(random() % bytes.size());
    num_refused += IsRefused(bytes) ? 1 : 0;
  }
  EXPECT_GT(num_refused, 100);
}

}  // namespace
}  // namespace plumb
