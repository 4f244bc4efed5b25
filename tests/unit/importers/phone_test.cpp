// SPDX-License-Identifier: Apache-2.0
// Folders as Record3D and Stray Scanner export them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <random>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/importers/import.hpp"
#include "drivers/importers/phone_metadata.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/importers/exr_writer.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using testing::ExrFile;
using ::testing::HasSubstr;
using testing::MessageOf;
using ::testing::Not;
using testing::TempFolder;

// The keys of a real export, which holds its images upright.
constexpr std::string_view kRecord3d =
    R"({"dh":64,"frameTimestamps":[0,0.0167,0.0334,0.0501],"dw":48,"fps":60,
    "poses":[[0,0,0,1,0,0,0]],"K":[351,0,0,0,351.5,0,181.25,240.75,1],"initPose":[0,0,0,1,0,0,0],
    "h":480,"cameraType":1,"w":360})";
constexpr std::string_view kMatrix = "338.5, 0.0, 179.25\n0.0, 338.5, 119.75\n0.0, 0.0, 1.0\n";
constexpr std::string_view kOdometry =
    "timestamp, frame, x, y, z, qx, qy, qz, qw\n"
    "2931.10, 000000, 0, 0, 0, 0, 0, 0, 1\n2931.12, 000001, 0, 0, 0, 0, 0, 0, 1\n"
    "2931.15, 000002, 0, 0, 0, 0, 0, 0, 1\n2931.16, 000003, 0, 0, 0, 0, 0, 0, 1\n";

void WriteImages(const fs::path& folder, const char* name, cv::Size color, cv::Size depth) {
  fs::create_directories(folder / "rgb");
  fs::create_directories(folder / "depth");
  for (int i = 0; i < 4; ++i) {
    const std::string stem = fmt::format(fmt::runtime(name), i);
    WriteWholeFile(folder / "rgb" / (stem + ".jpg"),
                   EncodeJpeg(cv::Mat(color, CV_8UC3, cv::Scalar(200, 20 * i, 10)), 95));
    WritePng(folder / "depth" / (stem + ".png"), cv::Mat(depth, CV_16UC1, cv::Scalar(800 + i)));
  }
}

TEST(PhoneFolderTest, Record3dGivesCameraStampsAndItsClass) {
  const TempFolder folder;
  // The archive holds one folder, and people unpack it and name what is around it.
  WriteImages(folder / "EXR_RGBD", "{}", {360, 480}, {48, 64});
  WriteWholeFile(folder / "EXR_RGBD/metadata.json", kRecord3d);
  ASSERT_TRUE(IsImportable(folder.path()));
  const auto recording = OpenImported(folder.path());
  EXPECT_EQ(recording->facts().format, "Record3D");
  EXPECT_EQ(recording->info().depth_sensor, DepthSensor::kLidar);
  const Intrinsics& color = recording->info().intrinsics;
  EXPECT_EQ(color.width, 360);
  EXPECT_EQ(color.fx, 351);
  EXPECT_EQ(color.fy, 351.5);
  EXPECT_EQ(color.cx, 181.25);
  EXPECT_EQ(color.cy, 240.75);
  const Intrinsics& depth = recording->facts().camera.depth_camera.value().intrinsics;
  EXPECT_EQ(depth.width, 48);
  EXPECT_NEAR(depth.fx, 351 / 7.5, 1e-9);
  // Pixel centres are at integers: (181.25 + 0.5) / 7.5 - 0.5.
  EXPECT_NEAR(depth.cx, 181.75 / 7.5 - 0.5, 1e-9);
  const Frame first = recording->Next().value(), second = recording->Next().value();
  EXPECT_NEAR(second.depth_time_s - first.depth_time_s, 0.0167, 1e-9);
  EXPECT_NEAR(second.depth_m.at<float>(240, 180), 0.801, 1e-5);
  EXPECT_NEAR(second.color_rgb.at<cv::Vec3b>(9, 9)[0], 200, 6);
}

TEST(PhoneFolderTest, ACameraThatFocusesHasItsMedianAndThatIsSaid) {
  const auto with = [](const std::string& cameras) {
    std::string text(kRecord3d);
    return text.insert(1, "\"perFrameIntrinsicCoeffs\":" + cameras + ",");
  };
  const TempFolder folder;
  WriteImages(folder.path(), "{}", {360, 480}, {48, 64});
  WriteWholeFile(folder / "metadata.json",
                 with("[[351,351.5,181.25,240.75],[354,354.5,181.5,241],[353,353.5,181.5,241],"
                      "[356,356.5,181.75,241.25]]"));
  const auto recording = OpenImported(folder.path());
  EXPECT_EQ(recording->info().intrinsics.fx, 354);
  EXPECT_EQ(recording->info().intrinsics.fy, 354.5);
  EXPECT_EQ(recording->info().intrinsics.cx, 181.5);
  EXPECT_EQ(recording->info().intrinsics.cy, 241);
  EXPECT_THAT(EnglishTexts(recording->info().warnings),
              Contains(AllOf(HasSubstr("changes by 1.4 %"), HasSubstr("354.0 px"))));
  WriteWholeFile(folder / "metadata.json", with("[[352,352.5,181,240],[352.1,352.5,181,240]]"));
  const auto steady = OpenImported(folder.path());
  EXPECT_EQ(steady->info().intrinsics.cx, 181);
  EXPECT_THAT(EnglishTexts(steady->info().warnings), Not(Contains(HasSubstr("focal length"))));
  // Of images that are stored turned, or not four numbers: the camera of the whole is kept.
  for (const char* cameras : {"[[351,351,240,181]]", "[[351,351.5,181]]", "[]", "[[1,\"a\",2,3]]"})
    EXPECT_EQ(ParseRecord3d(with(cameras), "a")->cx, 181.25) << cameras;
}

/// Maps of confidence: 2 but for the left third, which has `least`.
void WriteConfidence(const fs::path& folder, cv::Size size, int least, int most = 2) {
  fs::create_directories(folder / "confidence");
  for (int i = 0; i < 4; ++i) {
    cv::Mat map(size, CV_8UC1, cv::Scalar(most));
    map.colRange(0, size.width / 3).setTo(least);
    WritePng(folder / "confidence" / fmt::format("{:06}.png", i), map);
  }
}

class ConfidenceTest : public ::testing::Test {
 protected:
  ConfidenceTest() {
    WriteImages(folder_.path(), "{:06}", {360, 240}, {48, 32});
    WriteWholeFile(folder_ / "camera_matrix.csv", kMatrix);
    WriteWholeFile(folder_ / "odometry.csv", kOdometry);
  }
  struct Read {
    std::vector<std::string> warnings;
    float left_m = 0, right_m = 0;  ///< Of the second image.
  };
  [[nodiscard]] Read Second() const {
    const auto recording = OpenImported(folder_.path());
    (void)recording->Next();
    const Frame frame = recording->Next().value();
    return {EnglishTexts(recording->info().warnings), frame.depth_m.at<float>(120, 60),
            frame.depth_m.at<float>(120, 240)};
  }

  const TempFolder folder_;
};

TEST_F(ConfidenceTest, DepthBelowTheHighestIsLeftOutAndCounted) {
  for (const int least : {0, 1}) {
    WriteConfidence(folder_.path(), {48, 32}, least);
    const Read read = Second();
    EXPECT_EQ(read.left_m, 0.0F) << least;
    EXPECT_NEAR(read.right_m, 0.801, 1e-5) << least;
    EXPECT_THAT(read.warnings, Contains(HasSubstr("not sure of 33.3 % of the depth"))) << least;
  }
  WriteConfidence(folder_.path(), {48, 32}, 2);
  const Read read = Second();
  EXPECT_NEAR(read.left_m, 0.801, 1e-5);
  EXPECT_THAT(read.warnings, Not(Contains(HasSubstr("not sure"))));
}

TEST_F(ConfidenceTest, DepthInMetresIsLeftOutToo) {
  WriteConfidence(folder_.path(), {24, 16}, 1);  // A map of another size.
  fs::remove_all(folder_ / "depth");
  fs::create_directories(folder_ / "depth");
  for (int i = 0; i < 4; ++i)
    WriteWholeFile(folder_ / fmt::format("depth/{:06}.exr", i),
                   ExrFile(cv::Mat(32, 48, CV_32FC1, cv::Scalar(0.8))));
  const Read read = Second();
  EXPECT_EQ(read.left_m, 0.0F);
  EXPECT_NEAR(read.right_m, 0.8, 1e-5);
}

TEST_F(ConfidenceTest, WithoutAMapDepthIsUsedAsItIs) {
  EXPECT_NEAR(Second().left_m, 0.801, 1e-5) << "no folder";
  WriteConfidence(folder_.path(), {48, 32}, 0);
  fs::remove(folder_ / "confidence/000001.png");
  Read read = Second();
  EXPECT_NEAR(read.left_m, 0.801, 1e-5);
  EXPECT_THAT(read.warnings, Contains(HasSubstr("1 depth image has no map")));
  for (const auto& [least, most] : {std::pair{0, 255}, std::pair{0, 0}}) {
    WriteConfidence(folder_.path(), {48, 32}, least, most);
    read = Second();
    EXPECT_NEAR(read.left_m, 0.801, 1e-5) << "another scale";
    EXPECT_THAT(read.warnings, Contains(HasSubstr(fmt::format("largest value is {}", most))));
  }
  WriteWholeFile(folder_ / "confidence/000000.png", std::string_view("damaged"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)Second(); }), HasSubstr("000000.png"));
}

TEST(PhoneFolderTest, TheCameraAboveTheScreenProjectsDots) {
  std::string text(kRecord3d);
  text.replace(text.find("\"cameraType\":1"), 14, "\"cameraType\":0");
  EXPECT_EQ(ParseRecord3d(text, "a")->sensor, DepthSensor::kStructuredLight);
  EXPECT_EQ(ParseRecord3d("{\"fps\":30}", "a"), std::nullopt);
}

TEST(PhoneFolderTest, StrayScannerWithFramesGivesCameraAndStamps) {
  const TempFolder folder;
  WriteImages(folder.path(), "{:06}", {360, 240}, {48, 32});
  WriteWholeFile(folder / "camera_matrix.csv", kMatrix);
  WriteWholeFile(folder / "odometry.csv", kOdometry);
  fs::remove(folder / "depth/000001.png");
  const auto recording = OpenImported(folder.path());
  EXPECT_EQ(recording->facts().format, "Stray Scanner");
  EXPECT_EQ(recording->info().depth_sensor, DepthSensor::kLidar);
  EXPECT_EQ(recording->info().intrinsics.cy, 119.75);
  EXPECT_EQ(recording->info().num_frames, 3);
  EXPECT_THAT(EnglishTexts(recording->info().warnings), Contains(HasSubstr("1 image has")));
  (void)recording->Next();
  const Frame second = recording->Next().value();
  EXPECT_NEAR(second.color_time_s, 2931.15, 1e-9);
  EXPECT_NEAR(second.depth_m.at<float>(120, 180), 0.802, 1e-5);
}

TEST(PhoneFolderTest, AFrameThatStrayLeftOutHasNoStamp) {
  const PhoneMetadata phone =
      ParseStray(kMatrix, "timestamp, frame\n10.0, 000000\n10.1, 000002\n10.2, 000003\n");
  ASSERT_EQ(phone.stamps_s.size(), 4U);
  EXPECT_TRUE(std::isnan(phone.stamps_s[1]));
  EXPECT_EQ(phone.stamps_s[2], 10.1);
  EXPECT_THAT(MessageOf<DataError>([] { (void)ParseStray(kMatrix, "t, f\n10.1, 0\n10.0, 2\n"); }),
              HasSubstr("odometry.csv"));
  for (const char* rows : {"t, f\n10, 1\n11, 1\n", "t, f\n10, 2000000\n", "t, f\n10, -1\n"})
    EXPECT_THROW((void)ParseStray(kMatrix, rows), DataError) << rows;
  const TempFolder folder;
  WriteImages(folder.path(), "{:06}", {360, 240}, {48, 32});
  WriteWholeFile(folder / "camera_matrix.csv", kMatrix);
  WriteWholeFile(folder / "odometry.csv",
                 std::string_view("t, f\n10.0, 000000\n10.1, 000002\n10.2, 000003\n"));
  const auto recording = OpenImported(folder.path());
  EXPECT_EQ(recording->info().num_frames, 3);
  EXPECT_THAT(EnglishTexts(recording->info().warnings), Contains(HasSubstr("have no partner")));
}

TEST(PhoneFolderTest, WhatCannotBeReadIsNamedWithTheCommandThatConvertsIt) {
  const TempFolder folder;
  WriteImages(folder.path(), "{:06}", {360, 240}, {48, 32});
  WriteWholeFile(folder / "camera_matrix.csv", kMatrix);
  WriteWholeFile(folder / "odometry.csv", kOdometry);
  const auto refusal = [&] {
    return MessageOf<DataError>([&] { (void)OpenImported(folder.path()); });
  };
  fs::remove_all(folder / "rgb");
  WriteWholeFile(folder / "rgb.mp4", std::string_view("film"));
  EXPECT_THAT(refusal(), AllOf(HasSubstr("rgb.mp4"), HasSubstr("ffmpeg -noautorotate")));
  WriteImages(folder.path(), "{:06}", {360, 240}, {48, 48});
  EXPECT_THAT(refusal(), HasSubstr("48x48")) << "not the colour camera's view";
  fs::remove_all(folder / "depth");
  fs::create_directories(folder / "depth");
  std::vector<std::uint8_t> exr = ExrFile(cv::Mat(32, 48, CV_32FC1, cv::Scalar(0.8)));
  const std::string_view key("compression\0compression\0\1\0\0\0", 28);
  const auto at = std::search(exr.begin(), exr.end(), key.begin(), key.end());
  ASSERT_NE(at, exr.end());
  *(at + 28) = 4;  // PIZ
  WriteWholeFile(folder / "depth/000000.exr", exr);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("000000.exr"), HasSubstr("oiiotool FILE --comp")));
  WriteWholeFile(folder / "depth/000000.exr", std::string_view("exr"));
  EXPECT_THAT(refusal(), HasSubstr("it is shorter than it states"));
}

TEST(PhoneFolderTest, DepthAsOpenExrIsReadInMetres) {
  const TempFolder folder;
  WriteImages(folder / "EXR_RGBD", "{}", {360, 480}, {48, 64});
  WriteWholeFile(folder / "EXR_RGBD/metadata.json", kRecord3d);
  fs::remove_all(folder / "EXR_RGBD/depth");
  fs::create_directories(folder / "EXR_RGBD/depth");
  for (int i = 0; i < 4; ++i) {
    cv::Mat depth_m(64, 48, CV_32FC1, cv::Scalar(0.80037 + 0.001 * i));
    depth_m.row(0).setTo(std::numeric_limits<float>::quiet_NaN());
    WriteWholeFile(folder / fmt::format("EXR_RGBD/depth/{}.exr", i), ExrFile(depth_m));
  }
  const auto recording = OpenImported(folder.path());
  EXPECT_EQ(recording->facts().format, "Record3D");
  EXPECT_EQ(recording->facts().camera.depth_camera.value().intrinsics.width, 48);
  EXPECT_FALSE(recording->info().depth_unit_assumed);
  (void)recording->Next();
  const Frame second = recording->Next().value();
  EXPECT_NEAR(second.depth_m.at<float>(240, 180), 0.80137, 1e-6) << "not rounded to millimetres";
  EXPECT_EQ(second.depth_m.at<float>(1, 180), 0.0F);
  EXPECT_NEAR(second.depth_time_s, 0.0167, 1e-9);
}

TEST(PhoneFolderTest, FiveHundredDamagedTextsAreReadOrRefused) {
  std::mt19937 random(29);
  int num_refused = 0;
  for (int i = 0; i < 500; ++i) {
    std::string json(kRecord3d), matrix(kMatrix), odometry(kOdometry);
    for (std::string* text : {&json, &matrix, &odometry}) {
      for (int change = 0; change < 1 + i % 4; ++change)
        (*text)[random() % text->size()] = static_cast<char>(random() % 128);
      if (i % 5 == 0) text->resize(random() % text->size());
    }
    try {
      (void)ParseRecord3d(json, "metadata.json");
      (void)ParseStray(matrix, odometry);
    } catch (const DataError& error) {
      EXPECT_STRNE(error.what(), "");
      ++num_refused;
    }
  }
  EXPECT_GT(num_refused, 100);
}

}  // namespace
}  // namespace plumb
