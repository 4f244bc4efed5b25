// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/tum_recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <limits>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::TempFolder;

constexpr int kNumFrames = 12;

StreamInfo SmallCamera() {
  StreamInfo info;
  info.intrinsics = {.width = 64,
                     .height = 48,
                     .fx = 52.5,
                     .fy = 52.4,
                     .cx = 31.7,
                     .cy = 23.6,
                     .distortion = {0.01, -0.02, 0.001, 0, 0}};
  info.room_markers.dictionary = "DICT_5X5_100";
  info.room_markers.length_m = 0.08;
  info.room_markers.reference = 3;
  return info;
}

/// Frame i: its own grey level and its own depth, with one column without depth.
Frame NumberedFrame(int i, int width = 64, int height = 48) {
  Frame frame;
  frame.index = i;
  frame.color_time_s = 1000.0 + i / 30.0;
  frame.depth_time_s = frame.color_time_s + 0.006;
  frame.color_rgb = cv::Mat(height, width, CV_8UC3, cv::Scalar(10 * i, 10 * i + 1, 10 * i + 2));
  frame.depth_m = cv::Mat(height, width, CV_32FC1, cv::Scalar(0.5 + 0.1 * i));
  frame.depth_m.col(5).setTo(cv::Scalar(0));
  return frame;
}

/// A good recording that a test then damages.
class TumRecordingTest : public ::testing::Test {
 protected:
  void SetUp() override {
    TumWriter writer(recording_, SmallCamera(), {.jpeg_quality = 0});
    for (int i = 0; i < kNumFrames; ++i) writer.Add(NumberedFrame(i));
    writer.Finish();
  }

  /// The message of the refusal, by Open() or while the frames are read.
  [[nodiscard]] std::string Refusal() const {
    return MessageOf<DataError>([&] {
      const auto source = OpenTumRecording(recording_);
      while (source->Next()) {
      }
    });
  }

  [[nodiscard]] fs::path ColorFile(int i) const {
    return recording_ / fmt::format("rgb/{:.6f}.png", NumberedFrame(i).color_time_s);
  }
  [[nodiscard]] fs::path DepthFile(int i) const {
    return recording_ / fmt::format("depth/{:.6f}.png", NumberedFrame(i).depth_time_s);
  }

  TempFolder folder_;
  fs::path recording_ = folder_ / "recording";
};

TEST_F(TumRecordingTest, GivesBackWhatWasWritten) {
  const auto source = OpenTumRecording(recording_);
  EXPECT_EQ(source->info().intrinsics, SmallCamera().intrinsics);
  EXPECT_FALSE(source->info().intrinsics_assumed);
  EXPECT_EQ(source->info().room_markers.dictionary, "DICT_5X5_100");
  EXPECT_EQ(source->info().room_markers.length_m, 0.08);
  EXPECT_EQ(source->info().room_markers.reference, 3);
  EXPECT_EQ(source->info().num_frames, kNumFrames);
  EXPECT_THAT(source->info().warnings, ::testing::IsEmpty());
  for (int i = 0; i < kNumFrames; ++i) {
    const std::optional<Frame> frame = source->Next();
    ASSERT_TRUE(frame);
    const Frame expected = NumberedFrame(i);
    EXPECT_EQ(frame->index, i);
    EXPECT_NEAR(frame->color_time_s, expected.color_time_s, 5e-7);  // stamps have microseconds
    EXPECT_NEAR(frame->depth_time_s, expected.depth_time_s, 5e-7);
    EXPECT_EQ(cv::norm(frame->color_rgb, expected.color_rgb, cv::NORM_INF), 0);
    EXPECT_LE(cv::norm(frame->depth_m, expected.depth_m, cv::NORM_INF),
              1e-4 + 1e-6);  // half a unit of 1/5000 m
    EXPECT_EQ(frame->depth_m.at<float>(7, 5), 0.0F);
  }
  EXPECT_FALSE(source->Next());
  EXPECT_FALSE(source->Next());
}

TEST_F(TumRecordingTest, GivesBackARationalLens) {
  StreamInfo info = SmallCamera();
  info.intrinsics.distortion = {0.51, -2.74, 0.0006, -0.0002, 1.64, 0.39, -2.55, 1.56};
  const fs::path rational = folder_ / "rational";
  TumWriter writer(rational, info, {.jpeg_quality = 0});
  for (int i = 0; i < 2; ++i) writer.Add(NumberedFrame(i));
  writer.Finish();
  EXPECT_EQ(OpenTumRecording(rational)->info().intrinsics, info.intrinsics);
}

TEST_F(TumRecordingTest, StoppingEarlyEndsTheThread) {
  for (int frames = 0; frames < 3; ++frames) {
    const auto source = OpenTumRecording(recording_);
    for (int i = 0; i < frames; ++i) EXPECT_TRUE(source->Next());
  }
}

TEST_F(TumRecordingTest, ReadsJpegColour) {
  const fs::path jpeg = folder_ / "jpeg";
  TumWriter writer(jpeg, SmallCamera(), {.jpeg_quality = 95});
  for (int i = 0; i < 2; ++i) writer.Add(NumberedFrame(i + 4));
  writer.Finish();
  const auto frame = OpenTumRecording(jpeg)->Next();
  ASSERT_TRUE(frame);
  // Flat grey 40 41 42: JPEG's colour transform rounds by at most 2.
  EXPECT_LE(cv::norm(frame->color_rgb, NumberedFrame(4).color_rgb, cv::NORM_INF), 2);
}

TEST_F(TumRecordingTest, GivesBackWhichFramesWereFollowedWithFewerKeypoints) {
  EXPECT_FALSE(fs::exists(recording_ / "fewer_keypoints.txt"));
  const fs::path slow = folder_ / "slow_computer";
  TumWriter writer(slow, SmallCamera(), {.jpeg_quality = 0});
  for (int i = 0; i < kNumFrames; ++i) {
    Frame frame = NumberedFrame(i);
    frame.fewer_keypoints = i % 3 == 1;
    writer.Add(frame);
  }
  writer.Finish();
  const auto source = OpenTumRecording(slow);
  for (int i = 0; i < kNumFrames; ++i)
    EXPECT_EQ(source->Next().value().fewer_keypoints, i % 3 == 1) << i;
  WriteWholeFile(slow / "fewer_keypoints.txt", std::string_view("1000 ../depth/0.png\n"));
  EXPECT_THROW((void)OpenTumRecording(slow), DataError) << "checked as the other lists are";
}

TEST_F(TumRecordingTest, UnmatchedImagesAreLeftOutAndCounted) {
  std::string index = ReadTextFile(recording_ / "depth.txt", 1 << 20);
  const std::size_t line = index.find("1000.106");  // frame 3
  index.erase(line, index.find('\n', line) + 1 - line);
  WriteWholeFile(recording_ / "depth.txt", index);
  const auto source = OpenTumRecording(recording_);
  EXPECT_EQ(source->info().num_frames, kNumFrames - 1);
  EXPECT_THAT(EnglishTexts(source->info().warnings),
              Contains(HasSubstr("1 of 12 colour and 0 of 11 depth images")));
  for (int i = 0; i < 3; ++i) (void)source->Next();
  const auto after_gap = source->Next();
  EXPECT_NEAR(after_gap->color_time_s, NumberedFrame(4).color_time_s, 1e-6);
  EXPECT_EQ(after_gap->index, 3);
}

// A recording with a given frame rate whose depth stamps are later by the given time.
std::unique_ptr<FrameSource> OpenWithOffset(const fs::path& folder, double rate_hz,
                                            double offset_s) {
  TumWriter writer(folder, SmallCamera(), {.jpeg_quality = 0});
  for (int i = 0; i < kNumFrames; ++i) {
    Frame frame = NumberedFrame(i);
    frame.color_time_s = 1000.0 + i / rate_hz;
    frame.depth_time_s = frame.color_time_s + offset_s;
    writer.Add(frame);
  }
  writer.Finish();
  return OpenTumRecording(folder);
}

TEST_F(TumRecordingTest, SlowStreamsPairWithTheirNearestWhateverTheirOffset) {
  for (const int offset_ms : {0, 19, 25, 30, 33}) {
    const auto source =
        OpenWithOffset(folder_ / fmt::format("offset{}", offset_ms), 15.0, offset_ms * 1e-3);
    EXPECT_EQ(source->info().num_frames, kNumFrames) << offset_ms;
    const std::optional<Frame> frame = source->Next();
    ASSERT_TRUE(frame);
    EXPECT_NEAR(frame->depth_time_s - frame->color_time_s, offset_ms * 1e-3, 2e-6);
  }
}

TEST_F(TumRecordingTest, SlowStreamsDoNotPairAcrossALostImage) {
  const fs::path slow = folder_ / "slow";
  static_cast<void>(OpenWithOffset(slow, 15.0, 0.005));
  std::string index = ReadTextFile(slow / "depth.txt", 1 << 20);
  const std::size_t line = index.find("1000.205");  // frame 3
  ASSERT_NE(line, std::string::npos);
  index.erase(line, index.find('\n', line) + 1 - line);
  WriteWholeFile(slow / "depth.txt", index);
  const auto source = OpenTumRecording(slow);
  EXPECT_EQ(source->info().num_frames, kNumFrames - 1);
  while (const auto frame = source->Next())
    EXPECT_NEAR(frame->depth_time_s - frame->color_time_s, 0.005, 2e-6);
}

TEST_F(TumRecordingTest, WithoutCameraFileTumsCameraIsAssumedAtTheImagesSize) {
  fs::remove(recording_ / "camera.yaml");
  const auto source = OpenTumRecording(
      recording_, {.room_markers = {.dictionary = "DICT_4X4_50", .length_m = 0.1, .reference = 9}});
  EXPECT_TRUE(source->info().intrinsics_assumed);
  EXPECT_EQ(source->info().intrinsics.width, 64);
  EXPECT_DOUBLE_EQ(source->info().intrinsics.fx, 52.5);
  EXPECT_DOUBLE_EQ(source->info().intrinsics.cx, 31.5);
  EXPECT_EQ(source->info().room_markers.dictionary, "DICT_4X4_50");
  EXPECT_EQ(source->info().room_markers.reference, 9);
  EXPECT_THAT(EnglishTexts(source->info().warnings),
              Contains(HasSubstr("no camera.yaml: assumed fx 52.5")));
  EXPECT_NEAR(source->Next()->depth_m.at<float>(0, 0), 0.5F, 1e-4);  // 5000 units a metre
}

TEST_F(TumRecordingTest, AUnitThatNothingStatesIsTakenFromTheDepthAndSaid) {
  for (const double units : {1000.0, 5000.0}) {
    const fs::path folder = folder_ / fmt::format("{:g}", units);
    TumWriter writer(folder, SmallCamera(), {.depth_scale = units, .jpeg_quality = 0});
    for (int i = 0; i < kNumFrames; ++i) writer.Add(NumberedFrame(i));
    writer.Finish();
    fs::remove(folder / "camera.yaml");
    const auto source = OpenTumRecording(folder);
    EXPECT_TRUE(source->info().depth_unit_assumed);
    EXPECT_THAT(EnglishTexts(source->info().warnings),
                Contains(HasSubstr(fmt::format("{:g} units of depth", units))));
    EXPECT_NEAR(source->Next()->depth_m.at<float>(0, 0), 0.5F, 1e-3) << units;
  }
  EXPECT_FALSE(OpenTumRecording(recording_)->info().depth_unit_assumed);
}

TEST_F(TumRecordingTest, TheUnitThatTheMarkersShowIsTakenInstead) {
  fs::remove(recording_ / "camera.yaml");
  const auto source = OpenTumRecording(recording_, {.depth_scale = 4000.0});
  EXPECT_TRUE(source->info().depth_unit_assumed) << "the whole sweep has to confirm it";
  EXPECT_EQ(source->info().depth_units_per_metre, 4000.0);
  EXPECT_EQ(source->camera().depth_scale, 4000.0);
  EXPECT_THAT(EnglishTexts(source->info().warnings),
              Contains(HasSubstr("4000 units of depth for a metre taken, by the size")));
  EXPECT_NEAR(source->Next()->depth_m.at<float>(0, 0), 0.5 * 5000 / 4000, 1e-3);
  EXPECT_THROW((void)OpenTumRecording(recording_, {.depth_scale = -1.0}), std::invalid_argument);
}

TEST_F(TumRecordingTest, WhatIsAssumedStaysSoWhenItIsWrittenAgain) {
  fs::remove(recording_ / "camera.yaml");
  const auto source = OpenTumRecording(recording_);
  TumWriter writer(folder_ / "again", source->info(), {.jpeg_quality = 0});
  while (const auto frame = source->Next()) writer.Add(*frame);
  writer.Finish();
  const RoomMarkers room = {.dictionary = "DICT_4X4_50", .length_m = 0.15, .reference = 9};
  const auto again = OpenTumRecording(folder_ / "again", {.room_markers = room});
  EXPECT_EQ(again->info().intrinsics, source->info().intrinsics);
  EXPECT_TRUE(again->info().intrinsics_assumed);
  EXPECT_TRUE(again->info().depth_unit_assumed);
  EXPECT_EQ(again->info().room_markers, room) << "those of who reads it";
}

TEST_F(TumRecordingTest, WhatIsStatedStaysSoWhenItIsWrittenAgain) {
  const auto source = OpenTumRecording(recording_);
  const std::string text = CameraFileText(source->info(), 5000.0);
  EXPECT_EQ(text, ReadTextFile(recording_ / "camera.yaml", 1 << 16));
  EXPECT_EQ(text.find("assumed"), std::string::npos);
  StreamInfo half = source->info();
  half.marker_length_assumed = true;
  const std::string without_length = CameraFileText(half, 5000.0);
  EXPECT_NE(without_length.find("marker_dictionary"), std::string::npos);
  EXPECT_EQ(without_length.find("marker_length"), std::string::npos);
}

TEST_F(TumRecordingTest, DepthOfAnotherSizeNeedsItsCamera) {
  std::string text = ReadTextFile(recording_ / "camera.yaml", 1 << 16);
  text.replace(text.find("depth_registered: 1"), 19,
               "depth_registered: 0\ndepth_image_width: 80\ndepth_image_height: 48");
  WriteWholeFile(recording_ / "camera.yaml", text);
  for (int i = 0; i < kNumFrames; ++i) WritePng(DepthFile(i), cv::Mat::ones(48, 80, CV_16UC1));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("80x48"), HasSubstr("nothing states the depth camera"),
                               HasSubstr("T_color_depth")));
}

TEST_F(TumRecordingTest, ACalibrationOfAnotherNameIsUsedAndSaid) {
  fs::rename(recording_ / "camera.yaml", recording_ / "camera.yml");
  EXPECT_THAT(EnglishTexts(OpenTumRecording(recording_)->info().warnings),
              Contains(HasSubstr("no camera.yaml: the camera is taken from camera.yml")));
}

TEST_F(TumRecordingTest, LayoutsOfOtherProgramsAreNamed) {
  for (const char* name : {"color", "associations.txt", "sweep.bag", "frame-000000.color.jpg"}) {
    const fs::path folder = folder_ / "other" / name;
    fs::create_directories(folder / name);
    EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenTumRecording(folder); }),
                AllOf(HasSubstr("rgb.txt is missing"), HasSubstr(name)));
  }
}

TEST_F(TumRecordingTest, StampsThatAreNoSecondsAreNamed) {
  const auto warnings_or_refusal = [&](double factor) {
    for (const char* list : {"rgb.txt", "depth.txt"}) {
      std::string text;
      for (int i = 0; i < kNumFrames; ++i) {
        const Frame frame = NumberedFrame(i);
        const bool color = std::string_view(list) == "rgb.txt";
        text += fmt::format("{:.9f} {}\n", factor * i + 1,
                            fs::relative(color ? ColorFile(i) : DepthFile(i), recording_).string());
      }
      WriteWholeFile(recording_ / list, std::string_view(text));
    }
    try {
      return EnglishTexts(OpenTumRecording(recording_)->info().warnings);
    } catch (const DataError& error) {
      return std::vector<std::string>{error.what()};
    }
  };
  EXPECT_THAT(warnings_or_refusal(0.49), ::testing::IsEmpty());
  EXPECT_THAT(warnings_or_refusal(1.0), Contains(HasSubstr("numbers of images")));
  EXPECT_THAT(warnings_or_refusal(66.7), Contains(HasSubstr("milliseconds")));
  EXPECT_THAT(warnings_or_refusal(0.0005), Contains(HasSubstr("are the stamps seconds")));
}

TEST_F(TumRecordingTest, ImagesOfOtherKindsAreNamed) {
  const auto refusal = [&](std::string_view bytes) {
    WriteWholeFile(DepthFile(2), bytes);
    return Refusal();
  };
  EXPECT_THAT(refusal(std::string_view("II*\0....", 8)), HasSubstr("is TIFF"));
  EXPECT_THAT(refusal("P5 64 48 65535"), HasSubstr("is PGM"));
  EXPECT_THAT(refusal("RIFF0000WEBPVP8 "), HasSubstr("is WebP"));
  EXPECT_THAT(refusal("\x93NUMPY"), HasSubstr("is NumPy"));
  EXPECT_THAT(refusal("hello"), HasSubstr("68 65 6c 6c"));
}

TEST_F(TumRecordingTest, WithoutCameraFileOtherShapesNeedOne) {
  const fs::path wide = folder_ / "wide";
  TumWriter writer(wide, SmallCamera(), {.jpeg_quality = 0});
  for (int i = 0; i < 2; ++i) writer.Add(NumberedFrame(i, 80, 48));
  writer.Finish();
  fs::remove(wide / "camera.yaml");
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenTumRecording(wide); }),
              AllOf(HasSubstr("80x48"), HasSubstr("add camera.yaml")));
}

TEST_F(TumRecordingTest, UnregisteredDepthIsRegistered) {
  std::string text = ReadTextFile(recording_ / "camera.yaml", 1 << 16);
  const std::string registered = "depth_registered: 1";
  text.replace(
      text.find(registered), registered.size(),
      "depth_registered: 0\ndepth_camera_matrix: [ 52.5, 0, 31.7, 0, 52.4, 23.6, 0, 0, 1 ]\n"
      "depth_distortion_coefficients: [ 0.01, -0.02, 0.001, 0, 0 ]\n"
      "T_color_depth: [ 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.25, 0, 0, 0, 1 ]");
  WriteWholeFile(recording_ / "camera.yaml", text);
  const auto frame = OpenTumRecording(recording_)->Next();
  ASSERT_TRUE(frame);
  EXPECT_NEAR(frame->depth_m.at<float>(24, 32), 0.75F,
              1e-4);  // 0.5 m before a depth camera that stands 0.25 m in front

  // Under another name, and beside a file of another depth camera, it is the stated one, too.
  fs::rename(recording_ / "camera.yaml", recording_ / "camera.yml");
  text.replace(text.find("52.5"), 4, "40.5");
  WriteWholeFile(recording_ / "depth.yaml", std::string_view(text));
  const auto renamed = OpenTumRecording(recording_);
  EXPECT_FALSE(renamed->info().depth_camera_unknown);
  EXPECT_NEAR(renamed->Next()->depth_m.at<float>(24, 32), 0.75F, 1e-4);
}

TEST_F(TumRecordingTest, SaturatedDepthIsNothing) {
  WritePng(DepthFile(0), cv::Mat(48, 64, CV_16UC1, cv::Scalar(65535)));
  const auto source = OpenTumRecording(recording_);
  EXPECT_EQ(cv::countNonZero(source->Next()->depth_m), 0);
}

// ---- bad input: each is refused with the file, what was found and what is expected

TEST_F(TumRecordingTest, MissingFolderAndAFileInItsPlaceAreNamed) {
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenTumRecording(folder_ / "none"); }),
              AllOf(HasSubstr("none"), HasSubstr("missing")));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenTumRecording(recording_ / "rgb.txt"); }),
              HasSubstr("no folder"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenTumRecording(folder_.path()); }),
              HasSubstr("rgb.txt is missing"));
}

TEST_F(TumRecordingTest, MissingIndexIsNamed) {
  fs::remove(recording_ / "depth.txt");
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("depth.txt"), HasSubstr("missing")));
}

TEST_F(TumRecordingTest, EmptyIndexIsNamed) {
  WriteWholeFile(recording_ / "rgb.txt", std::string_view("# nothing\n"));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("rgb.txt"), HasSubstr("lists no image")));
}

TEST_F(TumRecordingTest, MissingImageIsNamedBeforeAnyWork) {
  fs::remove(ColorFile(7));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenTumRecording(recording_); }),
              AllOf(HasSubstr(ColorFile(7).filename()), HasSubstr("rgb.txt"),
                    HasSubstr("cannot be found")));
}

TEST_F(TumRecordingTest, TruncatedImageIsNamedAfterTheGoodFrames) {
  fs::resize_file(DepthFile(7), fs::file_size(DepthFile(7)) / 2);
  const auto source = OpenTumRecording(recording_);
  for (int i = 0; i < 7; ++i) EXPECT_TRUE(source->Next());
  EXPECT_THAT(MessageOf<DataError>([&] { (void)source->Next(); }),
              AllOf(HasSubstr(DepthFile(7).filename()), HasSubstr("damaged")));
  EXPECT_FALSE(source->Next());
}

TEST_F(TumRecordingTest, WrongSizeImagesAreNamed) {
  WritePng(ColorFile(2), cv::Mat::zeros(24, 32, CV_8UC3));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr(ColorFile(2).filename()), HasSubstr("32x24"),
                               HasSubstr("expected 64x48")));
  WritePng(ColorFile(2), cv::Mat::zeros(48, 64, CV_8UC3));
  WritePng(DepthFile(3), cv::Mat::zeros(24, 32, CV_16UC1));
  EXPECT_THAT(Refusal(),
              AllOf(HasSubstr("depth image"), HasSubstr("32x24"), HasSubstr("expected 64x48")));
}

TEST_F(TumRecordingTest, EightBitAndColourDepthAreNamed) {
  WritePng(DepthFile(2), cv::Mat::zeros(48, 64, CV_8UC1));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr(DepthFile(2).filename()), HasSubstr("8 bits")));
  WritePng(DepthFile(2), cv::Mat::zeros(48, 64, CV_8UC3));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr(DepthFile(2).filename()), HasSubstr("3 channels")));
}

TEST_F(TumRecordingTest, IntrinsicsForAnotherSizeAreNamed) {
  StreamInfo other = SmallCamera();
  other.intrinsics = Intrinsics{};
  WriteWholeFile(recording_ / "camera.yaml", CameraFileText(other, 5000));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("64x48"), HasSubstr("expected 640x480")));
}

TEST_F(TumRecordingTest, BadCameraFileIsNamed) {
  WriteWholeFile(recording_ / "camera.yaml", std::string_view("%YAML:1.0\n---\nimage_width: 64\n"));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("camera.yaml"), HasSubstr("image_height is missing")));
}

TEST_F(TumRecordingTest, LinksOutOfTheFolderAreNamed) {
  fs::rename(ColorFile(5), folder_ / "outside.png");
  fs::create_symlink(folder_ / "outside.png", ColorFile(5));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr(ColorFile(5).filename()),
                               HasSubstr("outside the recording's folder")));
  fs::remove(ColorFile(5));
  fs::copy_file(ColorFile(4), recording_ / "kept.png");
  fs::create_symlink("../kept.png", ColorFile(5));  // a link inside the folder is fine
  EXPECT_EQ(OpenTumRecording(recording_)->info().num_frames, kNumFrames);
}

TEST_F(TumRecordingTest, AFolderWhoseNameBeginsTheSameIsOutside) {
  fs::create_directory(folder_ / "recording2");
  fs::rename(ColorFile(5), folder_ / "recording2/a.png");
  fs::create_symlink("../../recording2/a.png", ColorFile(5));
  EXPECT_THAT(Refusal(), HasSubstr("outside the recording's folder"));
}

TEST_F(TumRecordingTest, ASingleFrameIsNamed) {
  WriteWholeFile(recording_ / "rgb.txt",
                 fmt::format("1000.000000 rgb/{}\n", ColorFile(0).filename().string()));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("has 1 frame ("), HasSubstr("at least 2")));
}

TEST_F(TumRecordingTest, ListsOfDifferentClocksAreNamed) {
  WriteWholeFile(recording_ / "rgb.txt",
                 fmt::format("5.0 rgb/{}\n6.0 rgb/{}\n", ColorFile(0).filename().string(),
                             ColorFile(1).filename().string()));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("has 0 frames"), HasSubstr("clock")));
}

TEST_F(TumRecordingTest, UnreadableIndexLinesAreNamed) {
  WriteWholeFile(recording_ / "rgb.txt", std::string_view("1000.0 rgb/a.png\nnan rgb/b.png\n"));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("rgb.txt line 2"), HasSubstr("nan")));
}

// ---- the writer

TEST_F(TumRecordingTest, TheWriterRefusesStampsThatDoNotRise) {
  TumWriter writer(folder_ / "w", SmallCamera());
  writer.Add(NumberedFrame(1));
  EXPECT_THROW(writer.Add(NumberedFrame(1)), std::invalid_argument);
  EXPECT_THROW(writer.Add(NumberedFrame(0)), std::invalid_argument);
  EXPECT_THROW(TumWriter(folder_ / "missing/parent", SmallCamera()), IoError);
}

TEST_F(TumRecordingTest, TheWriterRefusesStampsThatAreNoTimes) {
  TumWriter writer(folder_ / "w", SmallCamera());
  for (const double no_time_s :
       {-0.5, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Frame frame = NumberedFrame(0);
    frame.color_time_s = no_time_s;
    EXPECT_THROW(writer.Add(frame), std::invalid_argument) << no_time_s;
    frame = NumberedFrame(0);
    frame.depth_time_s = no_time_s;
    EXPECT_THROW(writer.Add(frame), std::invalid_argument) << no_time_s;
  }
  Frame first = NumberedFrame(0);
  first.color_time_s = first.depth_time_s = 0.0;
  writer.Add(first);  // The first stamp has none before it.
}

TEST_F(TumRecordingTest, DepthBeyondSixteenBitsIsWrittenAsNothing) {
  Frame frame = NumberedFrame(0);
  frame.depth_m.at<float>(0, 0) = 13.2F;  // 66000 units
  frame.depth_m.at<float>(0, 1) = std::numeric_limits<float>::quiet_NaN();
  const cv::Mat units = DecodeDepthImage(EncodeFrame(frame, {}).depth_file, "written");
  EXPECT_EQ(units.at<std::uint16_t>(0, 0), 0);
  EXPECT_EQ(units.at<std::uint16_t>(0, 1), 0);
  EXPECT_EQ(units.at<std::uint16_t>(0, 2), 2500);
}

TEST_F(TumRecordingTest, TheClassOfTheSensorComesBackWithWhatDiffersFromIt) {
  StreamInfo info = SmallCamera();
  info.depth_sensor = DepthSensor::kActiveStereo;
  info.depth_noise = ClassOf(info.depth_sensor).noise;
  info.usable_depth = {.nearest_m = 0.07, .farthest_m = 0.5};
  const fs::path folder = folder_ / "stereo";
  TumWriter writer(folder, info, {.jpeg_quality = 0});
  for (int i = 0; i < 2; ++i) writer.Add(NumberedFrame(i));
  writer.Finish();
  const std::string text = ReadTextFile(folder / "camera.yaml", 1 << 16);
  EXPECT_EQ(text.find("depth_noise"), std::string::npos) << "the class has it";
  const auto recording = OpenTumRecording(folder);
  EXPECT_EQ(recording->info().depth_sensor, info.depth_sensor);
  EXPECT_EQ(recording->info().depth_noise, info.depth_noise);
  EXPECT_EQ(recording->info().usable_depth, info.usable_depth);
}

TEST_F(TumRecordingTest, TheSensorsDepthNoiseComesBackToTheBit) {
  EXPECT_EQ(OpenTumRecording(recording_)->info().depth_noise, DepthNoise());
  EXPECT_EQ(ReadTextFile(recording_ / "camera.yaml", 1 << 16).find("depth_noise"),
            std::string::npos)
      << "recordings of structured light stay as they were";
  for (double DepthNoise::*member :
       {&DepthNoise::constant_m, &DepthNoise::linear_m_per_m, &DepthNoise::quadratic_m_per_m2,
        &DepthNoise::origin_m, &DepthNoise::grazing_m}) {
    StreamInfo info = SmallCamera();
    info.depth_noise.*member += 0.001 / 3;
    const fs::path folder = folder_ / "other";
    TumWriter writer(folder, info, {.jpeg_quality = 0});
    for (int i = 0; i < 2; ++i) writer.Add(NumberedFrame(i));
    writer.Finish();
    EXPECT_EQ(OpenTumRecording(folder)->info().depth_noise, info.depth_noise);
    fs::remove_all(folder);
  }
}

}  // namespace
}  // namespace plumb
