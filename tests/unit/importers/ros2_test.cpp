// SPDX-License-Identifier: Apache-2.0
// Recordings of ROS 2, in SQLite and in MCAP, from a writer of the test's own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/importers/import.hpp"
#include "drivers/importers/open_recorded_file.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/importers/read_from_memory.hpp"
#include "tests/unit/importers/ros2_writer.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Container;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::InMemory;
using testing::IsRefused;
using testing::MessageOf;
using ::testing::Not;
using testing::Ros2Message;
using testing::TempFolder;

constexpr int kFramesOfRos2 = 4;
constexpr std::uint32_t kWidth = 64, kHeight = 48, kDepthWidth = 32, kDepthHeight = 24;

/// What a test changes of the recording.
struct Ros2 {
  std::string color_encoding = "bgr8", depth_encoding = "16UC1";
  bool packed = false, frames = true;
};

double StampOf(int frame) { return 1700000000.25 + frame / 30.0; }

std::string PixelsOf(const cv::Mat& image) {
  return {reinterpret_cast<const char*>(image.data), image.total() * image.elemSize()};
}
std::string TextOf(const std::vector<std::uint8_t>& bytes) { return {bytes.begin(), bytes.end()}; }

Ros2Message ColorMessage(const Ros2& ros, int i) {
  const cv::Mat bgr(kHeight, kWidth, CV_8UC3, cv::Scalar(10, 20 * i, 200));
  const std::string frame = "camera_color_optical_frame";
  if (!ros.packed)
    return {
        "/camera/color/image_raw", "sensor_msgs/msg/Image",
        testing::Ros2Image(StampOf(i), frame, ros.color_encoding, kWidth, kHeight, PixelsOf(bgr))};
  const cv::Mat rgb(kHeight, kWidth, CV_8UC3, cv::Scalar(200, 20 * i, 10));
  return {"/camera/color/image_raw/compressed", "sensor_msgs/msg/CompressedImage",
          testing::Ros2Packed(StampOf(i), frame, "rgb8; jpeg compressed bgr8",
                              TextOf(EncodeJpeg(rgb, 95)))};
}

/// As compressed_depth_image_transport packs floats, with its defaults: depth_max 10 m and
/// depth_quantization 100.
std::string PackedFloats(double stamp_s, const std::string& frame, const cv::Mat& depth_m,
                         bool has_header = true) {
  const float a = 100.0F * (100.0F + 1.0F), b = 1.0F - a / 10.0F;
  cv::Mat inverse(depth_m.size(), CV_16UC1, cv::Scalar(0));
  for (int row = 0; row < inverse.rows; ++row)
    for (int column = 0; column < inverse.cols; ++column)
      if (const float z_m = depth_m.at<float>(row, column); z_m > 0 && z_m < 10)
        inverse.at<std::uint16_t>(row, column) = static_cast<std::uint16_t>(a / z_m + b);
  std::string data(has_header ? 4 : 0, '\0');
  for (const float term : {a, b})
    if (has_header) data.append(reinterpret_cast<const char*>(&term), sizeof term);
  return testing::Ros2Packed(stamp_s, frame, "32FC1; compressedDepth png",
                             data + TextOf(EncodePng(inverse)));
}

Ros2Message DepthMessage(const Ros2& ros, int i) {
  const bool is_float = ros.depth_encoding == "32FC1";
  cv::Mat depth(kDepthHeight, kDepthWidth, is_float ? CV_32FC1 : CV_16UC1,
                cv::Scalar(is_float ? 1.5 + 0.001 * i : 1500 + i));
  if (is_float) {
    depth.at<float>(0, 0) = NAN;
    depth.at<float>(0, 1) = INFINITY;
  }
  const std::string frame = "camera_depth_optical_frame";
  const double stamp_s = StampOf(i) + 0.004;
  if (!ros.packed)
    return {"/camera/depth/image_rect_raw", "sensor_msgs/msg/Image",
            testing::Ros2Image(stamp_s, frame, ros.depth_encoding, kDepthWidth, kDepthHeight,
                               PixelsOf(depth))};
  if (is_float)
    return {"/camera/depth/image_rect_raw/compressedDepth", "sensor_msgs/msg/CompressedImage",
            PackedFloats(stamp_s, frame, depth)};
  return {"/camera/depth/image_rect_raw/compressedDepth", "sensor_msgs/msg/CompressedImage",
          testing::Ros2Packed(stamp_s, frame, "16UC1; compressedDepth png",
                              std::string(12, '\1') + TextOf(EncodePng(depth)))};
}

std::vector<Ros2Message> Messages(const Ros2& ros = {}) {
  std::vector<Ros2Message> messages = {
      {"/rosout", "rcl_interfaces/msg/Log", std::string("\0\1\0\0 any", 8)},
      {"/camera/color/camera_info", "sensor_msgs/msg/CameraInfo",
       testing::Ros2Camera(60.25, 31.5, 23.25, kWidth, kHeight,
                           {0.05, -0.02, 0.001, 0.002, 0.003})},
      {"/camera/depth/camera_info", "sensor_msgs/msg/CameraInfo",
       testing::Ros2Camera(30.5, 15.25, 11.75, kDepthWidth, kDepthHeight, {0, 0, 0, 0, 0})}};
  if (ros.frames)
    // The colour camera is 15 mm to the left of the depth camera, and each has a frame between.
    messages.push_back({"/tf_static", "tf2_msgs/msg/TFMessage",
                        testing::Ros2Transforms(
                            {{"camera_link", "camera_depth_frame", 0.0, 0.1, 0.0},
                             {"camera_depth_frame", "camera_depth_optical_frame", 0.0, 0.0, 0.0},
                             {"camera_link", "camera_color_frame", -0.015, 0.1, 0.0},
                             {"camera_color_frame", "camera_color_optical_frame", 0, 0, 0.001}})});
  for (int i = 0; i < kFramesOfRos2; ++i) {
    messages.push_back(DepthMessage(ros, i));
    messages.push_back(ColorMessage(ros, i));
  }
  for (std::size_t i = 0; i < messages.size(); ++i) messages[i].time_ns = 1'000'000 * (i + 1);
  return messages;
}

class Ros2Test : public ::testing::TestWithParam<Container> {};
INSTANTIATE_TEST_SUITE_P(Containers, Ros2Test,
                         ::testing::Values(Container::kDatabase, Container::kMcapFlat,
                                           Container::kMcapPlain, Container::kMcapLz4,
                                           Container::kMcapZstd));

TEST_P(Ros2Test, CamerasTransformsAndFramesComeBack) {
  const TempFolder folder;
  const bool is_database = GetParam() == Container::kDatabase;
  const fs::path file = folder / (is_database ? "sweep.db3" : "sweep.mcap");
  WriteWholeFile(file, testing::InContainer(Messages(), GetParam()));
  ASSERT_TRUE(IsImportable(file));
  const auto recording = OpenImported(file);
  EXPECT_EQ(recording->facts().format, is_database ? "ROS 2 .db3" : "ROS 2 .mcap");
  const Intrinsics& color = recording->info().intrinsics;
  EXPECT_EQ(color.width, 64);
  EXPECT_EQ(color.fx, 60.25);
  EXPECT_EQ(color.cy, 23.25);
  EXPECT_EQ(color.distortion, (std::array<double, 8>{0.05, -0.02, 0.001, 0.002, 0.003}));
  const DepthCamera& depth = recording->facts().camera.depth_camera.value();
  EXPECT_EQ(depth.intrinsics.width, 32);
  EXPECT_EQ(depth.intrinsics.fx, 30.5);
  EXPECT_TRUE(depth.T_color_depth.translation().isApprox(Eigen::Vector3d(0.015, 0, -0.001)));
  EXPECT_EQ(recording->info().num_frames, kFramesOfRos2);
  for (int i = 0; i < kFramesOfRos2; ++i) {
    const Frame frame = recording->Next().value();
    EXPECT_NEAR(frame.color_time_s, StampOf(i), 2e-6);
    EXPECT_NEAR(frame.depth_time_s, StampOf(i) + 0.004, 2e-6);
    EXPECT_EQ(frame.color_rgb.at<cv::Vec3b>(5, 5), cv::Vec3b(200, 20 * i, 10));
    EXPECT_NEAR(frame.depth_m.at<float>(24, 32), 1.5 + 1e-3 * i - 0.001, 1e-5);
  }
  EXPECT_FALSE(recording->Next());
}

TEST_P(Ros2Test, PackedImagesAreUnpacked) {
  const std::vector<std::uint8_t> bytes =
      testing::InContainer(Messages({.packed = true}), GetParam());
  const auto file = OpenRecordedFile(InMemory(bytes));
  ASSERT_EQ(file->facts().color_s.size(), static_cast<std::size_t>(kFramesOfRos2));
  EXPECT_EQ(file->facts().camera["camera_matrix"][0], 60.25);
  EXPECT_EQ(file->facts().camera["depth_camera_matrix"][0], 30.5);
  EXPECT_NEAR(file->Color(2).at<cv::Vec3b>(20, 20)[0], 200, 6);
  EXPECT_EQ(file->Depth(2).at<std::uint16_t>(5, 5), 1502);
}

TEST_P(Ros2Test, DamagedFilesAreReadOrRefused) {
  std::mt19937 random(23);
  const std::vector<std::uint8_t> good =
      testing::InContainer(Messages({.packed = true}), GetParam());
  int num_refused = 0;
  for (int i = 0; i < 500; ++i) {
    std::vector<std::uint8_t> bytes = good;
    for (int change = 0; change < 1 + i % 8; ++change)
      bytes[random() % (i % 2 == 0 ? 1000 : bytes.size())] = static_cast<std::uint8_t>(random());
    if (i % 5 == 0) bytes.resize(random() % bytes.size());
    if (i % 7 == 0 && bytes.size() > 64)
      std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(random() % (bytes.size() - 8)), 4,
                  std::uint8_t{0xff});
    num_refused += IsRefused(bytes) ? 1 : 0;
  }
  EXPECT_GT(num_refused, 100);
}

RecordedFacts FactsOf(const std::vector<Ros2Message>& messages) {
  const std::vector<std::uint8_t> bytes = testing::InContainer(messages, Container::kMcapPlain);
  return OpenRecordedFile(InMemory(bytes))->facts();
}

TEST(Ros2FactsTest, DepthInMetresKeepsItsUnitAndItsHoles) {
  const std::vector<std::uint8_t> bytes =
      testing::InContainer(Messages({.depth_encoding = "32FC1"}), Container::kDatabase);
  const auto file = OpenRecordedFile(InMemory(bytes));
  const double units_per_metre = file->facts().camera["depth_scale"];
  const cv::Mat depth = file->Depth(3);
  EXPECT_NEAR(depth.at<std::uint16_t>(5, 5) / units_per_metre, 1.503, 1e-4);
  EXPECT_EQ(depth.at<std::uint16_t>(0, 0), 0);
  EXPECT_EQ(depth.at<std::uint16_t>(0, 1), 0);
}

TEST(Ros2FactsTest, PackedFloatsAreInverseDepth) {
  std::vector<Ros2Message> messages = Messages({.depth_encoding = "32FC1", .packed = true});
  cv::Mat depth_m(kDepthHeight, kDepthWidth, CV_32FC1, cv::Scalar(NAN));
  for (int row = 1; row < depth_m.rows; ++row) depth_m.row(row) = 0.5F * static_cast<float>(row);
  for (Ros2Message& message : messages)
    if (message.topic.ends_with("compressedDepth"))
      message.data = PackedFloats(StampOf(0) + 1e-9 * static_cast<double>(message.time_ns),
                                  "camera_depth_optical_frame", depth_m);
  const std::vector<std::uint8_t> bytes = testing::InContainer(messages, Container::kMcapPlain);
  const auto file = OpenRecordedFile(InMemory(bytes));
  const double units_per_metre = file->facts().camera["depth_scale"];
  const cv::Mat units = file->Depth(1);
  EXPECT_EQ(units.at<std::uint16_t>(0, 3), 0);
  for (int row = 1; row <= 16; ++row) {
    const double z_m = 0.5 * row;  // a step of v is z^2 / a
    EXPECT_NEAR(units.at<std::uint16_t>(row, 3) / units_per_metre, z_m, z_m * z_m / 10100 + 2e-4);
  }
  EXPECT_EQ(units.at<std::uint16_t>(20, 3), 0) << "farther than is packed";
  for (Ros2Message& message : messages)
    if (message.topic.ends_with("compressedDepth"))
      message.data = PackedFloats(StampOf(0) + 1e-9 * static_cast<double>(message.time_ns),
                                  "camera_depth_optical_frame", depth_m, false);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)FactsOf(messages); }), HasSubstr("no depth images"))
      << "nothing says what the values mean";
}

TEST(Ros2FactsTest, ATurnThatIsNoRotationIsRefused) {
  for (const double one : {1.0, 0.0}) {  // the zeros of a driver that sets none
    testing::Cdr extrinsics;
    for (int i = 0; i < 9; ++i) extrinsics.Add(i % 4 == 0 ? one : 0.0);
    for (const double t_m : {0.015, 0.0, 0.0}) extrinsics.Add(t_m);
    std::vector<Ros2Message> messages = Messages({.frames = false});
    messages.insert(messages.begin(),
                    {"/camera/extrinsics/depth_to_color", "realsense2_camera_msgs/msg/Extrinsics",
                     extrinsics.message()});
    if (one > 0)
      EXPECT_EQ(FactsOf(messages).camera["T_color_depth"][3], 0.015);
    else
      EXPECT_THAT(MessageOf<DataError>([&] { (void)FactsOf(messages); }),
                  HasSubstr("not a rotation"));
  }
}

TEST(Ros2FactsTest, ALogOfWritesBesideTheFileIsSaid) {
  const TempFolder folder;
  WriteWholeFile(folder / "sweep.db3", testing::AsDatabase(Messages()));
  const auto warnings = [&] {
    return EnglishTexts(OpenImported(folder / "sweep.db3")->info().warnings);
  };
  WriteWholeFile(folder / "sweep.db3-wal", std::string_view());
  EXPECT_THAT(warnings(), Not(Contains(HasSubstr("sweep.db3-wal"))));
  WriteWholeFile(folder / "sweep.db3-wal", std::string_view("frames"));
  EXPECT_THAT(warnings(), Contains(HasSubstr("sweep.db3-wal")));
}

TEST(Ros2FactsTest, WithoutTransformsThatIsSaid) {
  EXPECT_THAT(EnglishTexts(FactsOf(Messages({.frames = false})).warnings),
              Contains(HasSubstr("where the depth camera is")));
  std::vector<Ros2Message> ring = Messages({.frames = false});
  ring.push_back({"/tf_static", "tf2_msgs/msg/TFMessage",
                  testing::Ros2Transforms({{"camera_depth_optical_frame", "b", 1, 0, 0},
                                           {"b", "camera_depth_optical_frame", 1, 0, 0}})});
  EXPECT_THAT(EnglishTexts(FactsOf(ring).warnings),
              Contains(HasSubstr("where the depth camera is")));
}

TEST(Ros2FactsTest, ImagesOfOneFrameAreOfOneCamera) {
  std::vector<Ros2Message> messages = Messages({.frames = false});
  for (Ros2Message& message : messages)
    if (message.topic.find("/depth/image") != std::string::npos)
      message.data = testing::Ros2Image(StampOf(0) + 1e-9 * static_cast<double>(message.time_ns),
                                        "camera_color_optical_frame", "16UC1", kDepthWidth,
                                        kDepthHeight, std::string(std::size_t{2} * 32 * 24, '\3'));
  const RecordedFacts facts = FactsOf(messages);
  EXPECT_EQ(facts.camera["T_color_depth"][3], 0.0);
  EXPECT_THAT(EnglishTexts(facts.warnings), Not(Contains(HasSubstr("where the depth camera is"))));
}

TEST(Ros2FactsTest, AlignedDepthIsPreferredAndNeedsNoTransforms) {
  std::vector<Ros2Message> messages = Messages({.frames = false});
  for (int i = 0; i < kFramesOfRos2; ++i)
    messages.push_back(
        {"/camera/aligned_depth_to_color/image_raw", "sensor_msgs/msg/Image",
         testing::Ros2Image(StampOf(i), "camera_color_optical_frame", "16UC1", kWidth, kHeight,
                            std::string(std::size_t{2} * 64 * 48, '\3'))});
  messages.push_back({"/camera/aligned_depth_to_color/camera_info", "sensor_msgs/msg/CameraInfo",
                      testing::Ros2Camera(60.25, 31.5, 23.25, kWidth, kHeight, {})});
  const RecordedFacts facts = FactsOf(messages);
  EXPECT_EQ(facts.camera["depth_registered"], 1);
  EXPECT_EQ(facts.depth_s.size(), static_cast<std::size_t>(kFramesOfRos2));
}

/// Images of one topic, stamped as the others, with a camera_info beside them.
void AddTopic(std::vector<Ros2Message>& messages, const std::string& topic,
              const std::string& encoding, int value, bool first = false) {
  std::vector<Ros2Message> added = {
      {topic.substr(0, topic.rfind('/')) + "/camera_info", "sensor_msgs/msg/CameraInfo",
       testing::Ros2Camera(30.5, 15.25, 11.75, kDepthWidth, kDepthHeight, {0, 0, 0, 0, 0})}};
  const std::size_t bytes = encoding == "rgb8" ? 3 : 2;
  for (int i = 0; i < kFramesOfRos2; ++i)
    added.push_back(
        {topic, "sensor_msgs/msg/Image",
         testing::Ros2Image(
             StampOf(i), "camera_depth_optical_frame", encoding, kDepthWidth, kDepthHeight,
             std::string(bytes * kDepthWidth * kDepthHeight, static_cast<char>(value)))});
  messages.insert(first ? messages.begin() : messages.end(), added.begin(), added.end());
}

/// A pixel of the second depth image.
int DepthOf(const std::vector<Ros2Message>& messages) {
  const std::vector<std::uint8_t> bytes = testing::InContainer(messages, Container::kMcapPlain);
  return OpenRecordedFile(InMemory(bytes))->Depth(1).at<std::uint16_t>(5, 5);
}

TEST(Ros2FactsTest, InfraredIsNoDepthInAnyOrder) {
  for (const bool first : {true, false})
    for (const auto& [topic, encoding] :
         {std::pair{"/ir/image_raw", "mono16"}, std::pair{"/kinect2/sd/image_ir", "16UC1"},
          std::pair{"/camera/infra1/image_rect_raw", "16UC1"},
          std::pair{"/camera/left_ir2/image", "16UC1"},
          // Brightness by its kind, whatever its name.
          std::pair{"/camera/amplitude/image_raw", "mono16"}}) {
      std::vector<Ros2Message> messages = Messages();
      AddTopic(messages, topic, encoding, 7, first);
      EXPECT_EQ(DepthOf(messages), 1501) << topic << (first ? " first" : " last");
    }
  std::vector<Ros2Message> only = Messages();
  for (Ros2Message& message : only)
    if (message.topic.find("/depth/image") != std::string::npos) message.topic = "/ir/image_raw";
  EXPECT_THAT(MessageOf<DataError>([&] { (void)FactsOf(only); }), HasSubstr("no depth images"));
}

TEST(Ros2FactsTest, DepthThatIsNamedGreyIsReadWhereThereIsNoOther) {
  EXPECT_EQ(DepthOf(Messages({.depth_encoding = "mono16"})), 1501);
  std::vector<Ros2Message> messages = Messages();
  for (Ros2Message& message : messages)  // Of a robot with such a name.
    if (message.topic.starts_with("/camera")) message.topic = "/ir" + message.topic;
  EXPECT_EQ(DepthOf(messages), 1501);
}

TEST(Ros2FactsTest, ColourInTheDepthCamerasViewGoesWithDepthOfItsOwnCameraOnly) {
  for (const bool first : {true, false}) {
    std::vector<Ros2Message> messages = Messages();
    AddTopic(messages, "/rgb_to_depth/image_raw", "rgb8", 90, first);
    EXPECT_EQ(FactsOf(messages).camera["camera_matrix"][0], 60.25) << "colour of its own camera";
    AddTopic(messages, "/depth_to_rgb/image_raw", "16UC1", 3, first);
    EXPECT_EQ(FactsOf(messages).camera["depth_registered"], 1);
    EXPECT_EQ(DepthOf(messages), 0x0303);
  }
  std::vector<Ros2Message> without = Messages({.frames = false});
  std::erase_if(without, [](const Ros2Message& message) {
    return message.topic.starts_with("/camera/color");
  });
  AddTopic(without, "/rgb_to_depth/image_raw", "rgb8", 90);
  const RecordedFacts facts = FactsOf(without);
  EXPECT_EQ(facts.camera["camera_matrix"][0], 30.5);
  EXPECT_EQ(facts.camera["depth_registered"], 0);
  EXPECT_EQ(facts.camera["T_color_depth"][3], 0.0) << "one view";
  EXPECT_EQ(DepthOf(without), 1501);
}

constexpr std::array<double, 9> kStraight = {1, 0, 0, 0, 1, 0, 0, 0, 1};
constexpr std::array<double, 12> kProjection = {58.5, 0, 30.25, 0, 0, 59.5, 22.5, 0, 0, 0, 1, 0};

/// Of colour images on this topic, whose camera_info has these.
RecordedFacts FactsOfColor(const std::string& topic, const std::vector<double>& lens,
                           const std::array<double, 9>& r, const std::array<double, 12>& p,
                           std::vector<Ros2Message> messages = Messages()) {
  for (Ros2Message& message : messages) {
    if (message.topic == "/camera/color/image_raw") message.topic = topic;
    if (message.topic == "/camera/color/camera_info")
      message.data = testing::Ros2Camera(60.25, 31.5, 23.25, kWidth, kHeight, lens, r, p);
  }
  return FactsOf(messages);
}

TEST(Ros2FactsTest, RectifiedImagesHaveTheProjectionsCameraAndNoLens) {
  const std::vector<double> lens = {0.15, -0.2, 0.001, 0.002, 0.0};
  for (const char* name : {"image_rect_color", "image_color_rect", "image_rect"}) {
    const RecordedFacts facts =
        FactsOfColor(std::string("/camera/color/") + name, lens, kStraight, kProjection);
    EXPECT_EQ(facts.camera["camera_matrix"],
              nlohmann::ordered_json({58.5, 0.0, 30.25, 0.0, 59.5, 22.5, 0.0, 0.0, 1.0}))
        << name;
    EXPECT_EQ(facts.camera["distortion_coefficients"],
              nlohmann::ordered_json({0.0, 0.0, 0.0, 0.0, 0.0}));
  }
  for (const char* name : {"image_raw", "image_color", "image_direct"}) {
    const RecordedFacts facts =
        FactsOfColor(std::string("/camera/color/") + name, lens, kStraight, kProjection);
    EXPECT_EQ(facts.camera["camera_matrix"][0], 60.25) << name;
    EXPECT_EQ(facts.camera["distortion_coefficients"][0], 0.15) << name;
  }
  EXPECT_EQ(FactsOfColor("/camera/color/image_rect_color", {0, 0, 0, 0, 0}, kStraight, kProjection)
                .camera["camera_matrix"][0],
            60.25)
      << "nothing was undone";
}

TEST(Ros2FactsTest, ARectifiedCameraThatIsNotStatedIsRefused) {
  std::array<double, 9> turned = kStraight;
  turned[1] = 0.01;
  turned[3] = -0.01;
  for (const auto& [r, p] :
       {std::pair{turned, kProjection}, std::pair{kStraight, std::array<double, 12>()}})
    EXPECT_THAT(MessageOf<DataError>([&, r = r, p = p] {
                  (void)FactsOfColor("/camera/color/image_rect_color", {0.1, 0, 0, 0, 0}, r, p);
                }),
                AllOf(HasSubstr("colour images are rectified"), HasSubstr("image_raw")));
}

TEST(Ros2FactsTest, AlignedDepthIsRegisteredToImagesOfItsKindOnly) {
  std::vector<Ros2Message> messages = Messages({.frames = false});
  AddTopic(messages, "/camera/aligned_depth_to_color/image_raw", "16UC1", 3);
  const auto color = [&](const std::string& name, double k1) {
    return FactsOfColor("/camera/color/" + name, {k1, 0, 0, 0, 0}, kStraight, kProjection, messages)
        .camera;
  };
  EXPECT_EQ(color("image_raw", 0.1)["depth_registered"], 1);
  EXPECT_EQ(color("image_rect_color", 0.0)["depth_registered"], 1);
  const nlohmann::ordered_json own = color("image_rect_color", 0.1);
  EXPECT_EQ(own["depth_registered"], 0) << "depth lies on the pixels that were not rectified";
  EXPECT_EQ(own["depth_camera_matrix"][0], 30.5);
  EXPECT_EQ(own["T_color_depth"][3], 0.0);
}

/// The class of a recording whose topics, or frames, have this in their names, and what is warned.
std::pair<DepthSensor, std::string> ClassBy(const std::string& topic_begin,
                                            const std::string& frame = "") {
  std::vector<Ros2Message> messages = Messages();
  for (Ros2Message& message : messages) {
    if (message.topic.starts_with("/camera"))
      message.topic.replace(0, std::string_view("/camera").size(), topic_begin);
    for (std::size_t at = 0;
         !frame.empty() && (at = message.data.find("camera_", at)) != message.data.npos;
         at += frame.size())
      message.data.replace(at, frame.size(), frame);
  }
  const TempFolder folder;
  WriteWholeFile(folder / "sweep.mcap", testing::InContainer(messages, Container::kMcapPlain));
  const auto recording = OpenImported(folder / "sweep.mcap");
  std::string warned;
  for (const std::string& text : EnglishTexts(recording->info().warnings))
    if (text.find("class of the depth camera") != std::string::npos) warned += text;
  return {recording->info().depth_sensor, warned};
}

TEST(Ros2ClassTest, IsGuessedByTheNamesOfTopicsAndFramesAndSaid) {
  for (const auto& [name, sensor] : {std::pair{"/k4a", DepthSensor::kTimeOfFlight},
                                     std::pair{"/femto_bolt", DepthSensor::kTimeOfFlight},
                                     std::pair{"/kinect2/hd", DepthSensor::kTimeOfFlight},
                                     std::pair{"/L515", DepthSensor::kTimeOfFlight},
                                     std::pair{"/camera/realsense", DepthSensor::kActiveStereo},
                                     std::pair{"/D455_left", DepthSensor::kActiveStereo},
                                     std::pair{"/gemini_335", DepthSensor::kActiveStereo}}) {
    const auto [found, warned] = ClassBy(name);
    EXPECT_EQ(found, sensor) << name;
    EXPECT_THAT(warned, AllOf(HasSubstr("taken as " + std::string(Name(sensor))), HasSubstr(name),
                              HasSubstr("sweep.mcap.yaml")));
  }
  EXPECT_EQ(ClassBy("/camera", "openni_").first, DepthSensor::kStructuredLight);
  EXPECT_THAT(ClassBy("/camera", "openni_").second, HasSubstr("openni"));
  EXPECT_THAT(ClassBy("/camera").second, AllOf(HasSubstr("structured_light is taken"),
                                               HasSubstr("depth_sensor in camera.yaml")));
}

TEST(Ros2ClassTest, DepthAlignedByTheDriverOfRealSenseIsActiveStereo) {
  std::vector<Ros2Message> messages = Messages();
  AddTopic(messages, "/camera/aligned_depth_to_color/image_raw", "16UC1", 3);
  EXPECT_EQ(FactsOf(messages).camera["depth_sensor"], "active_stereo");
  EXPECT_EQ(FactsOf(messages).class_by, "/camera/aligned_depth_to_color/image_raw");
}

TEST(Ros2ClassTest, AFileBesideTheRecordingStatesItOrLeavesIt) {
  const TempFolder folder;
  std::vector<Ros2Message> messages = Messages();
  for (Ros2Message& message : messages)
    if (message.topic.starts_with("/camera")) message.topic.replace(0, 7, "/k4a");
  WriteWholeFile(folder / "a.mcap", testing::InContainer(messages, Container::kMcapPlain));
  const std::string camera =
      "image_width: 64\nimage_height: 48\ncamera_matrix: [60, 0, 32, 0, 60, 24, 0, 0, 1]\n"
      "distortion_coefficients: [0, 0, 0, 0, 0]\ndepth_scale: 1000\n";
  const auto open = [&](const std::string& more) {
    WriteWholeFile(folder / "a.mcap.yaml", camera + more);
    return OpenImported(folder / "a.mcap");
  };
  const auto left = open("");
  EXPECT_EQ(left->info().depth_sensor, DepthSensor::kTimeOfFlight);
  EXPECT_EQ(left->info().depth_noise, ClassOf(DepthSensor::kTimeOfFlight).noise);
  EXPECT_THAT(EnglishTexts(left->info().warnings), Contains(HasSubstr("by the name /k4a")));
  const auto stated = open("depth_sensor: active_stereo\n");
  EXPECT_EQ(stated->info().depth_sensor, DepthSensor::kActiveStereo);
  EXPECT_THAT(EnglishTexts(stated->info().warnings),
              Not(Contains(HasSubstr("class of the depth camera"))));
}

TEST(Ros2FactsTest, MessagesOutOfOrderAreSorted) {
  std::vector<Ros2Message> messages = Messages();
  std::swap(messages[messages.size() - 1], messages[messages.size() - 3]);
  const RecordedFacts facts = FactsOf(messages);
  ASSERT_EQ(facts.color_s.size(), static_cast<std::size_t>(kFramesOfRos2));
  EXPECT_NEAR(facts.color_s.back(), StampOf(kFramesOfRos2 - 1), 1e-6);
}

TEST(Ros2FactsTest, ADatabaseWithALogOrPackedMessagesIsRead) {
  std::vector<std::uint8_t> bytes = testing::AsDatabase(Messages(), true);
  bytes[18] = bytes[19] = 2;  // As a recorder leaves it that kept a log of writes.
  const auto file = OpenRecordedFile(InMemory(bytes));
  EXPECT_EQ(file->Depth(1).at<std::uint16_t>(5, 5), 1501);
}

TEST(Ros2RefusalTest, AFolderOfRosIsReadByItsOneFile) {
  const TempFolder folder;
  WriteWholeFile(folder / "metadata.yaml", std::string_view("rosbag2_bagfile_information:\n"));
  EXPECT_FALSE(IsImportable(folder.path()));
  WriteWholeFile(folder / "sweep_0.db3", testing::AsDatabase(Messages()));
  ASSERT_TRUE(IsImportable(folder.path()));
  EXPECT_EQ(OpenImported(folder.path())->info().num_frames, kFramesOfRos2);
  WriteWholeFile(folder / "sweep_1.db3", testing::AsDatabase(Messages()));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenImported(folder.path()); }),
              HasSubstr("ros2 bag convert"));
}

TEST(Ros2RefusalTest, WhatCannotBeReadIsNamed) {
  std::vector<std::uint8_t> bytes = testing::InContainer(Messages(), Container::kMcapLz4);
  bytes.resize(bytes.size() / 2);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenRecordedFile(InMemory(bytes)); }),
              AllOf(HasSubstr("cut off at byte"), HasSubstr("mcap recover")));
  std::vector<std::uint8_t> other = testing::AsDatabase({});
  const std::string_view table = "messages";  // In what SQLite keeps of each table.
  for (auto at = other.begin();
       (at = std::search(at, other.end(), table.begin(), table.end())) != other.end();)
    *at = 'M';
  for (auto at = other.begin();
       (at = std::search(at, other.end(), table.begin() + 1, table.end())) != other.end();)
    *at = 'x';
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenRecordedFile(InMemory(other)); }),
              AllOf(HasSubstr("ROS 2"), HasSubstr("rtabmap-export")));
  std::vector<Ros2Message> big_endian = Messages();
  for (Ros2Message& message : big_endian) message.data[1] = '\0';
  EXPECT_THAT(MessageOf<DataError>([&] { (void)FactsOf(big_endian); }), HasSubstr("big-endian"));
}

}  // namespace
}  // namespace plumb
