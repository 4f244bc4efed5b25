// SPDX-License-Identifier: Apache-2.0
// RealSense .bag files from a writer of the test's own: read in this process and through the child.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/importers/file_recording.hpp"
#include "drivers/importers/import.hpp"
#include "drivers/importers/open_recorded_file.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/importers/bag_writer.hpp"
#include "tests/unit/importers/read_from_memory.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::BagStreamTruth;
using testing::BagWriter;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::InMemory;
using testing::IsRefused;
using testing::MessageOf;
using testing::TempFolder;
using Packing = BagWriter::Packing;

constexpr int kFramesOfBag = 5;
const BagStreamTruth kDepth = {.topic = "/device_0/sensor_0/Depth_0",
                               .width = 32,
                               .height = 24,
                               .encoding = "mono16",
                               .f = 20.5,
                               .cx = 15.25,
                               .cy = 11.75};
const BagStreamTruth kColor = {.topic = "/device_0/sensor_1/Color_0",
                               .width = 64,
                               .height = 48,
                               .encoding = "rgb8",
                               .f = 60.25,
                               .cx = 31.5,
                               .cy = 23.25,
                               .model = "Inverse Brown Conrady",
                               .distortion = {0.05, -0.02, 0.001, -0.002, 0.003}};

/// What a test changes of the file.
struct Bag {
  Packing packing = Packing::kLz4;
  BagStreamTruth depth = kDepth, color = kColor;
  bool unit = true, poses = true, metadata = true;
  int frames = kFramesOfBag;
};

std::string Pixels(const BagStreamTruth& stream, int frame) {
  std::size_t bytes = stream.encoding == "rgb8" || stream.encoding == "bgr8" ? 3 : 2;
  if (stream.encoding == "rgba8") bytes = 4;
  std::string pixels(bytes * stream.width * stream.height, '\0');
  for (std::size_t i = 0; i < pixels.size(); ++i)
    pixels[i] = static_cast<char>((i * 7 + static_cast<std::size_t>(frame) * 13) % 251);
  if (stream.encoding == "mono16" || stream.encoding == "16UC1") {
    for (std::size_t i = 0; i + 1 < pixels.size(); i += 2) {  // A wall at 1 m.
      const auto units = static_cast<std::uint16_t>(10000 + frame);
      std::memcpy(&pixels[i], &units, 2);
    }
  }
  return pixels;
}

/// Stamps of the sensor's clock just before its 32 bits of microseconds start again.
double SensorTime_us(int frame) { return 4294967295.0 - 50000.0 + 33333.0 * frame; }
double Wrapped(double us) { return us >= 4294967296.0 ? us - 4294967296.0 : us; }

void WriteImage(BagWriter& writer, const BagStreamTruth& stream, const Bag& bag, int frame,
                double mid_us) {
  const double time_s = 0.5 + frame / 30.0;
  writer.Image(stream, Pixels(stream, frame), 100.0 + frame / 30.0, time_s);
  if (!bag.metadata) return;
  const std::string topic = stream.topic + "/image/metadata";
  const auto text = [](double value) { return std::to_string(static_cast<std::int64_t>(value)); };
  writer.KeyValue(topic, "timestamp_domain", "Hardware Clock", time_s);
  if (frame % 2 == 0) {
    writer.KeyValue(topic, "Sensor Timestamp", text(Wrapped(mid_us)), time_s);
  } else {  // The same moment, said in the other way.
    writer.KeyValue(topic, "Frame Timestamp", text(Wrapped(mid_us) + 3000), time_s);
    writer.KeyValue(topic, "Actual Exposure", "6000", time_s);
  }
}

std::vector<std::uint8_t> Write(const Bag& bag) {
  BagWriter writer(bag.packing);
  writer.Message("/file_version", "std_msgs/UInt32",
                 testing::Packed().Add(std::uint32_t{3}).bytes());
  writer.Camera(bag.depth);
  writer.Camera(bag.color);
  writer.KeyValue("/device_0/info", "Name", "Intel RealSense D435");
  writer.KeyValue("/device_0/info", "Serial Number", "012345678901");
  writer.KeyValue("/device_0/info", "Firmware Version", "05.15.00.02");
  const auto option = [&](const std::string& name, float value) {
    writer.Message("/device_0/sensor_0/option/" + name + "/value", "std_msgs/Float32",
                   testing::Packed().Add(value).bytes());
  };
  if (bag.unit) option("Depth Units", 0.0001F);
  option("Stereo Baseline", 50.0F);
  writer.EndChunk();
  for (int frame = 0; frame < bag.frames; ++frame) {
    WriteImage(writer, bag.depth, bag, frame, SensorTime_us(frame));
    if (frame == 0 && bag.poses) writer.Pose(bag.depth, {0, 0, 0});
    writer.EndChunk();
    WriteImage(writer, bag.color, bag, frame, SensorTime_us(frame) + 4000);
    if (frame == 0 && bag.poses) writer.Pose(bag.color, {0.015, 0.0, 0.001});
    writer.EndChunk();
  }
  return writer.Finish();
}

std::string RefusalOf(const Bag& bag) {
  const std::vector<std::uint8_t> bytes = Write(bag);
  return MessageOf<DataError>([&] {
    const auto file = OpenRecordedFile(InMemory(bytes));
    (void)file->Color(0);
    (void)file->Depth(0);
  });
}

class BagTest : public ::testing::TestWithParam<Packing> {};
INSTANTIATE_TEST_SUITE_P(Packings, BagTest, ::testing::Values(Packing::kNone, Packing::kLz4));

TEST_P(BagTest, WhatIsInTheFileIsRecognised) {
  const TempFolder folder;
  WriteWholeFile(folder / "sweep.bag", Write({.packing = GetParam()}));
  ASSERT_TRUE(IsImportable(folder / "sweep.bag"));
  const auto recording = OpenImported(folder / "sweep.bag");
  const ImportedFacts& facts = recording->facts();
  EXPECT_EQ(facts.format, "RealSense .bag");
  EXPECT_EQ(facts.name, "Intel RealSense D435");
  EXPECT_EQ(facts.camera.depth_sensor, DepthSensor::kActiveStereo);
  EXPECT_EQ(facts.serial, "012345678901");
  EXPECT_EQ(facts.firmware, "05.15.00.02");
  EXPECT_NEAR(facts.stereo_baseline_m.value(), 0.05, 1e-9);
  EXPECT_NEAR(facts.camera.depth_scale.value(), 10000.0, 0.01);
  EXPECT_EQ(facts.color_images, kFramesOfBag);
  ASSERT_EQ(facts.depth_s.size(), static_cast<std::size_t>(kFramesOfBag));
  const Intrinsics& color = recording->info().intrinsics;
  EXPECT_EQ(color.width, 64);
  EXPECT_EQ(color.height, 48);
  EXPECT_EQ(color.fx, 60.25);
  EXPECT_EQ(color.cy, 23.25);
  EXPECT_EQ(color.distortion, (std::array<double, 8>{0.05, -0.02, 0.001, -0.002, 0.003}));
  const DepthCamera& depth = facts.camera.depth_camera.value();
  EXPECT_EQ(depth.intrinsics.width, 32);
  EXPECT_EQ(depth.intrinsics.fx, 20.5);
  EXPECT_EQ(depth.intrinsics.cx, 15.25);
  EXPECT_TRUE(depth.T_color_depth.translation().isApprox(Eigen::Vector3d(0.015, 0, 0.001)));
  EXPECT_FALSE(recording->info().intrinsics_assumed);
}

TEST_P(BagTest, FramesComeBackWithDepthRegisteredAndStampsOfTheExposure) {
  const TempFolder folder;
  WriteWholeFile(folder / "sweep.bag", Write({.packing = GetParam()}));
  const auto recording = OpenImported(folder / "sweep.bag");
  for (int i = 0; i < kFramesOfBag; ++i) {
    const std::optional<Frame> frame = recording->Next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->index, i);
    // The counter starts again after the second image; the stamps do not.
    EXPECT_NEAR(frame->depth_time_s, 1e-6 * SensorTime_us(i), 2e-6);
    EXPECT_NEAR(frame->color_time_s, 1e-6 * (SensorTime_us(i) + 4000), 2e-6);
    const std::string pixels = Pixels(kColor, i);
    ASSERT_EQ(frame->color_rgb.size(), cv::Size(64, 48));
    EXPECT_EQ(std::memcmp(frame->color_rgb.data, pixels.data(), pixels.size()), 0);
    ASSERT_EQ(frame->depth_m.size(), cv::Size(64, 48));
    // 1 mm nearer to the colour camera... which is 1 mm further along z.
    EXPECT_NEAR(frame->depth_m.at<float>(24, 32), 1.001 + 1e-4 * i, 1e-5);
  }
  EXPECT_FALSE(recording->Next());
}

TEST(BagFactsTest, WithoutMetadataTheRecordersStampsAreTakenAndThatIsSaid) {
  const std::vector<std::uint8_t> bytes = Write({.metadata = false});
  const RecordedFacts facts = OpenRecordedFile(InMemory(bytes))->facts();
  EXPECT_NEAR(facts.depth_s.at(1), 100.0 + 1 / 30.0, 1e-6);
  EXPECT_THAT(EnglishTexts(facts.warnings), Contains(HasSubstr("when the images were exposed")));
}

TEST(BagFactsTest, WhatIsMissingIsSaidAndASideCarStatesIt) {
  const TempFolder folder;
  const fs::path file = folder / "sweep.bag";
  WriteWholeFile(file, Write({.unit = false, .poses = false}));
  const auto recording = OpenFileRecording(file);
  EXPECT_THAT(EnglishTexts(recording->info().warnings),
              AllOf(Contains(HasSubstr("missing: the unit")),
                    Contains(HasSubstr("missing: where the depth camera is"))));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)recording->Next(); }),
              AllOf(HasSubstr("depth_scale"), HasSubstr("sweep.bag.yaml")));
  WriteWholeFile(folder / "sweep.bag.yaml",
                 std::string_view("image_width: 64\nimage_height: 48\n"
                                  "camera_matrix: [60, 0, 32, 0, 60, 24, 0, 0, 1]\n"
                                  "distortion_coefficients: [0, 0, 0, 0, 0]\n"
                                  "depth_scale: 10000\ndepth_registered: 0\n"
                                  "depth_image_width: 32\ndepth_image_height: 24\n"
                                  "depth_camera_matrix: [20, 0, 16, 0, 20, 12, 0, 0, 1]\n"
                                  "depth_distortion_coefficients: [0, 0, 0, 0, 0]\n"
                                  "T_color_depth: [1,0,0,0.02, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n"
                                  "marker_dictionary: DICT_6X6_250\nmarker_length: 0.1\n"));
  const auto again = OpenFileRecording(file);
  EXPECT_EQ(again->info().intrinsics.fx, 60);
  EXPECT_EQ(again->info().room_markers.length_m, 0.1);
  EXPECT_NEAR(again->Next().value().depth_m.at<float>(24, 32), 1.0, 1e-5);
}

TEST(BagFactsTest, ColoursOfOtherOrdersBecomeRgb) {
  for (const char* encoding : {"bgr8", "rgba8", "yuyv"}) {
    Bag bag;
    bag.color.encoding = encoding;
    const std::vector<std::uint8_t> bytes = Write(bag);
    const cv::Mat image = OpenRecordedFile(InMemory(bytes))->Color(1);
    EXPECT_EQ(image.type(), CV_8UC3) << encoding;
    EXPECT_EQ(image.size(), cv::Size(64, 48)) << encoding;
    const std::string pixels = Pixels(bag.color, 1);
    const std::uint8_t red = std::string(encoding) == "bgr8" ? pixels[2] : pixels[0];
    if (std::string(encoding) != "yuyv") {
      EXPECT_EQ(image.at<cv::Vec3b>(0, 0)[0], red) << encoding;
    }
  }
}

TEST(BagFactsTest, TopicsOfARosDriverAreReadToo) {
  BagWriter writer(Packing::kLz4);
  BagStreamTruth color = kColor, depth = kDepth, aligned = kColor;
  color.topic = "/camera/color";
  color.model = "plumb_bob";
  depth.topic = "/camera/depth";
  depth.encoding = aligned.encoding = "16UC1";
  aligned.topic = "/camera/aligned_depth_to_color";
  const auto add = [&](const BagStreamTruth& stream, int frame) {
    // The test's writer appends the topics of librealsense; a driver of ROS has these.
    writer.RosCamera(stream);
    writer.RosImage(stream, Pixels(stream, frame), 50.0 + frame / 30.0);
  };
  for (int frame = 0; frame < 3; ++frame)
    for (const BagStreamTruth* stream : {&depth, &color, &aligned}) add(*stream, frame);
  const std::vector<std::uint8_t> bytes = writer.Finish();
  const auto file = OpenRecordedFile(InMemory(bytes));
  const RecordedFacts& facts = file->facts();
  EXPECT_EQ(facts.format, "ROS bag");
  EXPECT_EQ(facts.camera["depth_registered"], 1);
  EXPECT_EQ(facts.camera["depth_scale"], 1000.0);
  EXPECT_EQ(facts.camera["camera_matrix"][0], 60.25);
  ASSERT_EQ(facts.depth_s.size(), 3U);
  EXPECT_NEAR(facts.depth_s[1], 50.0 + 1 / 30.0, 1e-6);
  EXPECT_EQ(file->Depth(2).size(), cv::Size(64, 48)) << "the aligned images";
}

TEST(BagRefusalTest, WhatCannotBeReadIsNamed) {
  EXPECT_THAT(RefusalOf({.packing = Packing::kBz2}), HasSubstr("rosbag decompress"));
  Bag bag;
  bag.color.model = "Kannala Brandt4";
  EXPECT_THAT(RefusalOf(bag), HasSubstr("Kannala Brandt4"));
  bag = {};
  bag.color.encoding = "raw10";
  EXPECT_THAT(RefusalOf(bag), AllOf(HasSubstr("raw10"), HasSubstr("rgb8")));
  bag = {};
  bag.color.topic = "/device_0/sensor_0/Infrared_1";
  EXPECT_THAT(RefusalOf(bag), HasSubstr("no colour images"));
}

TEST(BagRefusalTest, AFileThatIsCutOffSaysWhere) {
  const std::vector<std::uint8_t> bytes = Write({});
  const std::vector<std::uint8_t> cut(bytes.begin(), bytes.end() - 100);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenRecordedFile(InMemory(cut)); }),
              AllOf(HasSubstr("cut off at byte"), HasSubstr("rosbag reindex")));
}

TEST(BagRefusalTest, OnePairIsNoSweep) {
  const TempFolder folder;
  WriteWholeFile(folder / "short.bag", Write({.frames = 1}));
  const auto recording = OpenFileRecording(folder / "short.bag");
  EXPECT_EQ(recording->info().num_frames, 1);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)recording->Next(); }),
              HasSubstr("1 pair of images"));
}

TEST(BagRefusalTest, FiveHundredDamagedFilesAreReadOrRefused) {
  std::mt19937 random(7);
  int num_refused = 0;
  for (const Packing packing : {Packing::kNone, Packing::kLz4}) {
    const std::vector<std::uint8_t> good = Write({.packing = packing, .frames = 2});
    for (int i = 0; i < 250; ++i) {
      std::vector<std::uint8_t> bytes = good;
      // Numbers of records and lengths are in the first bytes of what follows them.
      for (int change = 0; change < 1 + i % 3; ++change)
        bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
      if (i % 5 == 0) bytes.resize(random() % bytes.size());
      if (i % 7 == 0 && bytes.size() > 64)
        std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(random() % (bytes.size() - 8)), 4,
                    std::uint8_t{0xff});
      num_refused += IsRefused(bytes) ? 1 : 0;
    }
  }
  EXPECT_GT(num_refused, 100);
}

TEST(BagRefusalTest, TheChildTellsWhatIsWrong) {
  const TempFolder folder;
  std::vector<std::uint8_t> bytes = Write({.packing = Packing::kLz4});
  bytes.resize(bytes.size() / 2);
  WriteWholeFile(folder / "damaged.bag", bytes);
  EXPECT_THAT(MessageOf<DataError>([&] {
                const auto recording = OpenFileRecording(folder / "damaged.bag");
                while (recording->Next()) {
                }
              }),
              AllOf(HasSubstr("damaged.bag"), HasSubstr("cut off")));
  WriteWholeFile(folder / "other.bag", std::string_view("no bag at all"));
  EXPECT_FALSE(IsImportable(folder / "other.bag"));
}

TEST(BagRefusalTest, FormatsThatAreNotReadAreNamedWithWhatConvertsThem) {
  EXPECT_THAT(MessageOf<DataError>([] { RefuseUnreadFormat("sweep.db3.zstd"); }),
              AllOf(HasSubstr("ROS 2"), HasSubstr("zstd -d")));
  EXPECT_NO_THROW(RefuseUnreadFormat("sweep.oni"));
}

}  // namespace
}  // namespace plumb
