// SPDX-License-Identifier: Apache-2.0
// Folders of images as other programs write them, and the calibrations beside them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <random>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/importers/import.hpp"
#include "drivers/replay/device_class.hpp"
#include "drivers/replay/foreign_calibration.hpp"
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

const cv::Size kSize(640, 480);

constexpr const char* kOpen3d = R"({"width": 640, "height": 480,
  "intrinsic_matrix": [610.5, 0, 0, 0, 609.25, 0, 318.5, 241.75, 1],
  "depth_scale": 1000.0, "fps": 15.0, "device_name": "Intel RealSense D435", "serial_number": "77"})";

void WriteImages(const fs::path& color, const fs::path& depth, const std::string& color_name,
                 const std::string& depth_name, int first, int count, int width = 64,
                 int height = 48) {
  fs::create_directories(color);
  fs::create_directories(depth);
  for (int i = first; i < first + count; ++i) {
    const cv::Mat rgb(height, width, CV_8UC3, cv::Scalar(i, 100, 200));
    cv::Mat units(height, width, CV_16UC1, cv::Scalar(1000 + i));
    units.at<std::uint16_t>(0, 0) = 65535;
    WritePng(color / fmt::format(fmt::runtime(color_name), i), rgb);
    WritePng(depth / fmt::format(fmt::runtime(depth_name), i), units);
  }
}

TEST(ImageFolderTest, AnOpen3dFolderIsReadWithItsColumnsRateAndUnit) {
  const TempFolder folder;
  WriteImages(folder / "color", folder / "depth", "{:05}.png", "{:05}.png", 0, 4, 640, 480);
  WriteWholeFile(folder / "intrinsic.json", std::string_view(kOpen3d));
  ASSERT_TRUE(IsImportable(folder.path()));
  const auto recording = OpenImported(folder.path());
  const Intrinsics& camera = recording->info().intrinsics;
  EXPECT_EQ(camera.fx, 610.5);
  EXPECT_EQ(camera.fy, 609.25);
  EXPECT_EQ(camera.cx, 318.5);
  EXPECT_EQ(camera.cy, 241.75);
  EXPECT_EQ(recording->facts().serial, "77");
  EXPECT_EQ(recording->info().num_frames, 4);
  EXPECT_THAT(EnglishTexts(recording->info().warnings),
              Contains(AllOf(HasSubstr("no time stamps"), HasSubstr("15 Hz"))));
  const Frame first = recording->Next().value(), second = recording->Next().value();
  EXPECT_NEAR(second.depth_time_s - first.depth_time_s, 1 / 15.0, 1e-9);
  EXPECT_NEAR(first.depth_m.at<float>(5, 5), 1.0, 1e-6);
  EXPECT_EQ(first.depth_m.at<float>(0, 0), 0.0F);
  EXPECT_EQ(first.color_rgb.at<cv::Vec3b>(1, 1), cv::Vec3b(0, 100, 200));
}

TEST(ImageFolderTest, TheClassOfTheDeviceReachesTheFramesAndTheImportedFolder) {
  const TempFolder folder;
  WriteImages(folder / "color", folder / "depth", "{}.png", "{}.png", 0, 3, 640, 480);
  const std::string_view open3d = kOpen3d;
  for (const auto& [device, sensor] : {std::pair{"Azure Kinect", DepthSensor::kTimeOfFlight},
                                       {"Orbbec Femto Bolt", DepthSensor::kTimeOfFlight},
                                       {"Kinect for Windows v2", DepthSensor::kTimeOfFlight},
                                       {"iPhone 15 Pro", DepthSensor::kLidar},
                                       {"Intel RealSense D455", DepthSensor::kActiveStereo},
                                       {"ASUS Xtion PRO LIVE", DepthSensor::kStructuredLight}}) {
    std::string text(open3d);
    text.replace(text.find("Intel RealSense D435"), 20, device);
    WriteWholeFile(folder / "intrinsic.json", text);
    const auto recording = OpenImported(folder.path());
    EXPECT_EQ(recording->facts().camera.depth_sensor, sensor) << device;
    EXPECT_EQ(recording->info().depth_sensor, sensor) << device;
    EXPECT_EQ(recording->info().depth_noise, ClassOf(sensor).noise) << device;
    const TempFolder out;
    TumWriter writer(out.path(), recording->info(), {.depth_scale = 5000.0, .jpeg_quality = 0});
    while (const auto frame = recording->Next()) writer.Add(*frame);
    writer.Finish();
    EXPECT_EQ(OpenTumRecording(out.path())->info().depth_sensor, sensor) << device;
  }
  EXPECT_EQ(ClassOfDevice("Kinect"), std::nullopt) << "three classes have had that name";
  EXPECT_EQ(ClassOfDevice(""), std::nullopt);
  EXPECT_EQ(ClassOfDevice("Intel RealSense SR305"), DepthSensor::kStructuredLight);
}

TEST(ImageFolderTest, PartnersHaveTheSameNumberAndTheRateCanBeStated) {
  const TempFolder folder;
  WriteImages(folder / "images", folder / "depth", "frame{}.png", "d_{:04}.png", 8, 4);
  fs::remove(folder / "images/frame9.png");
  WriteWholeFile(
      folder / "camera.json",
      std::string_view(R"({"fx": 60, "fy": 60, "cx": 32, "cy": 24, "depth_scale": 1.0})"));
  RecordingDefaults defaults;
  defaults.rate_hz = 10.0;
  const auto recording = OpenImported(folder.path(), defaults);
  EXPECT_EQ(recording->info().num_frames, 3);
  EXPECT_THAT(EnglishTexts(recording->info().warnings), Contains(HasSubstr("1 image has")));
  (void)recording->Next();
  const Frame second = recording->Next().value();
  EXPECT_NEAR(second.color_time_s, 0.2, 1e-9) << "two images after the first";
  EXPECT_NEAR(second.depth_m.at<float>(5, 5), 1.010, 1e-6) << "BOP's scale is millimetres a unit";
}

TEST(ImageFolderTest, NamesThatAreStampsAreTakenAsSuch) {
  for (const char* ending : {"", "nanoseconds"}) {
    const TempFolder folder;
    const bool seconds = std::string(ending).empty();
    WriteImages(folder / "rgb", folder / "depth",
                seconds ? "1000.{:02}0000.png" : "1700000000{:02}0000000.png",
                seconds ? "1000.{:02}5000.png" : "1700000000{:02}5000000.png", 3, 4);
    WriteWholeFile(folder / "camera.json",
                   std::string_view(R"({"fx": 60, "fy": 60, "cx": 32, "cy": 24})"));
    const auto recording = OpenImported(folder.path());
    EXPECT_EQ(recording->info().num_frames, 4);
    const Frame first = recording->Next().value(), second = recording->Next().value();
    EXPECT_NEAR(first.depth_time_s - first.color_time_s, 0.005, 1e-6) << ending;
    EXPECT_NEAR(second.color_time_s - first.color_time_s, 0.01, 1e-6) << ending;
  }
}

TEST(ImageFolderTest, SevenScenesHasItsPublishedCamera) {
  const TempFolder folder;
  WriteImages(folder.path(), folder.path(), "frame-{:06}.color.png", "frame-{:06}.depth.png", 0, 3,
              640, 480);
  const auto recording = OpenImported(folder.path());
  EXPECT_EQ(recording->facts().format, "7-Scenes");
  EXPECT_EQ(recording->info().intrinsics.fx, 585);
  EXPECT_TRUE(recording->info().intrinsics_assumed);
  EXPECT_TRUE(recording->Next());
}

TEST(ImageFolderTest, WithoutCalibrationItIsRefusedWithWhatIsRead) {
  const TempFolder folder;
  WriteImages(folder / "rgb", folder / "depth", "{}.png", "{}.png", 0, 3);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenImported(folder.path()); }),
              AllOf(HasSubstr("no calibration"), HasSubstr("camera_intrinsic.json")));
}

TEST(ImageFolderTest, NamesThatTellNoPartnerAreRefused) {
  const TempFolder folder;
  WriteImages(folder / "rgb", folder / "depth", "{}.png", "{}.png", 0, 2);
  WriteWholeFile(folder / "camera.json",
                 std::string_view(R"({"fx": 60, "fy": 60, "cx": 32, "cy": 24})"));
  fs::copy_file(folder / "rgb/1.png", folder / "rgb/other.png");
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenImported(folder.path()); }),
              HasSubstr("other.png"));
  fs::rename(folder / "rgb/other.png", folder / "rgb/a1.png");
  EXPECT_THAT(MessageOf<DataError>([&] { (void)OpenImported(folder.path()); }),
              HasSubstr("two images with the number 1"));
}

TEST(ForeignCalibrationTest, EachProgramsFileIsRead) {
  const auto read = [](const char* text, const char* name) {
    return ParseForeignCalibration(text, name, 640, 480).value();
  };
  const ForeignCalibration slam = read(
      "%YAML:1.0\nCamera.type: \"PinHole\"\nCamera.fx: 517.3 # px\nCamera.fy: 516.5\n"
      "Camera.cx: 318.6\nCamera.cy: 255.3\nCamera.k1: 0.05\nCamera.k2: -0.1\nCamera.p1: 0.001\n"
      "Camera.p2: 0.002\nCamera.k3: 0.01\nCamera.width: 640\nCamera.height: 480\n"
      "Camera.fps: 30.0\nCamera.bf: 40.0\nDepthMapFactor: 5000.0\n",
      "TUM1.yaml");
  EXPECT_EQ(slam.program, "ORB-SLAM");
  EXPECT_EQ(slam.camera.color.fx, 517.3);
  EXPECT_EQ(slam.camera.color.distortion, (std::array<double, 8>{0.05, -0.1, 0.001, 0.002, 0.01}));
  EXPECT_EQ(slam.camera.depth_scale, 5000.0);
  EXPECT_EQ(slam.rate_hz, 30.0);
  EXPECT_EQ(read("Camera1.fx: 600\nCamera1.fy: 601\nCamera1.cx: 320\nCamera1.cy: 240\n"
                 "RGBD.DepthMapFactor: 1000\n",
                 "d435.yaml")
                .camera.depth_scale,
            1000.0);
  const ForeignCalibration ros = read(
      "image_width: 640\nimage_height: 480\ncamera_name: rgb\ncamera_matrix:\n  rows: 3\n  cols: "
      "3\n"
      "  data: [525.5, 0, 319, 0, 526, 240, 0, 0, 1]\ndistortion_model: plumb_bob\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, 0, 0, 0, 0]\n",
      "ost.yaml");
  EXPECT_EQ(ros.camera.color.fx, 525.5);
  EXPECT_EQ(ros.camera.color.distortion[0], 0.1);
  EXPECT_EQ(read("585.5 0 320\n0 586 240\n0 0 1\n", "camera-intrinsics.txt").camera.color.fy, 586);
  EXPECT_EQ(
      read("577 0 318 0\n0 578 242 0\n0 0 1 0\n0 0 0 1\n", "intrinsic_color.txt").camera.color.cy,
      242);
  EXPECT_EQ(
      read(R"({"fx": 1200, "fy": 1200, "ppx": 640, "ppy": 480, "width": 1280, "height": 960})",
           "intrinsics.json")
          .camera.color.fx,
      600)
      << "scaled to the images";
}

TEST(ForeignCalibrationTest, AFisheyeLensOfOrbSlamIsEquidistant) {
  const auto found = ParseForeignCalibration(
      "Camera.type: \"KannalaBrandt8\"\nCamera.fx: 400\nCamera.fy: 400\nCamera.cx: 320\n"
      "Camera.cy: 240\nCamera.k1: -0.012\nCamera.k2: 0.031\nCamera.k3: 0\nCamera.k4: 0\n",
      "a.yaml", 640, 480);
  ASSERT_TRUE(found);
  // 0.5 rad from the axis.
  EXPECT_NEAR(Project(found->camera.color, {std::tan(0.5), 0, 1}).x(),
              320 + 400 * 0.5 * (1 - 0.012 * 0.25 + 0.031 * 0.0625), 0.02);
}

TEST(ForeignCalibrationTest, WhatCannotBeUsedIsNamed) {
  const auto refusal = [](const char* text, const char* name) {
    return MessageOf<DataError>([&] { (void)ParseForeignCalibration(text, name, 640, 480); });
  };
  EXPECT_THAT(refusal("Camera.type: \"KannalaBrandt8\"\nCamera.fx: 110\nCamera.fy: 110\n"
                      "Camera.cx: 320\nCamera.cy: 240\nCamera.k1: 0.01\n",
                      "a.yaml"),
              HasSubstr("farther than 75 deg"));
  EXPECT_THAT(refusal(R"({"intrinsic_matrix": [610, 0, 318, 0, 609, 241, 0, 0, 1]})", "a.json"),
              HasSubstr("by columns"));
  EXPECT_THAT(
      refusal(R"({"fx": 600, "fy": 600, "cx": 400, "cy": 400, "width": 800, "height": 800})",
              "a.json"),
      HasSubstr("800x800"));
  EXPECT_EQ(ParseForeignCalibration("{\"poses\": []}", "a.json", 640, 480), std::nullopt);
  EXPECT_EQ(ParseForeignCalibration("a: 1\n", "a.yaml", 640, 480), std::nullopt);
  EXPECT_EQ(ParseForeignCalibration("1 2 3\n", "camera.txt", 640, 480), std::nullopt);
}

TEST(ForeignCalibrationTest, TheLensOfAJsonIsRead) {
  const auto lens = [](const std::string& keys) {
    const std::string text =
        R"({"fx": 600, "fy": 600, "ppx": 320, "ppy": 240, "width": 640, "height": 480)" + keys +
        "}";
    return ParseForeignCalibration(text, "a.json", 640, 480).value().camera;
  };
  using Lens = std::array<double, 8>;
  EXPECT_EQ(lens(R"(, "model": "distortion.inverse_brown_conrady",
                  "coeffs": [-0.05, 0.06, 0.001, 0.002, -0.02])")
                .color.distortion,
            (Lens{-0.05, 0.06, 0.001, 0.002, -0.02}));
  EXPECT_EQ(lens(R"(, "dist_coeffs": [[0.1, -0.2, 0, 0]])").color.distortion, (Lens{0.1, -0.2}));
  EXPECT_EQ(lens(R"(, "distortion": [0.1, 0, 0, 0, 0, 0.2, 0, 0])").color.distortion,
            (Lens{0.1, 0, 0, 0, 0, 0.2}));
  EXPECT_EQ(lens(R"(, "distortion": {"k1": 0.1, "p2": 0.01})").color.distortion,
            (Lens{0.1, 0, 0, 0.01}));
  EXPECT_EQ(
      lens(R"(, "k1": 0.1, "k2": -0.2, "p1": 0.001, "p2": 0.002, "k3": 0.01)").color.distortion,
      (Lens{0.1, -0.2, 0.001, 0.002, 0.01}));
  // 0.3 rad from the axis of an equidistant lens.
  const CameraFile fisheye =
      lens(R"(, "camera_model": "OPENCV_FISHEYE", "k1": 0.0, "k2": 0.0, "k3": 0.0, "k4": 0.0)");
  EXPECT_NEAR(Project(fisheye.color, {std::tan(0.3), 0, 1}).x(), 320 + 600 * 0.3, 0.05);
  EXPECT_THAT(EnglishTexts(lens("").warnings), Contains(HasSubstr("no distortion_coefficients")));
  EXPECT_THAT(EnglishTexts(lens(R"(, "coeffs": [0, 0, 0, 0, 0], "model": "f-theta")").warnings),
              ::testing::IsEmpty())
      << "without coefficients the model is of no interest";
  for (const char* refused : {R"(, "model": "distortion.ftheta", "coeffs": [0.1, 0, 0, 0, 0])",
                              R"(, "camera_model": "fisheye")"})
    EXPECT_THAT(MessageOf<DataError>([&] { (void)lens(refused); }), HasSubstr("the lens is"))
        << refused;
  EXPECT_THAT(MessageOf<DataError>([&] { (void)lens(R"(, "coeffs": ["a"])"); }),
              HasSubstr("coeffs is not a number"));
}

constexpr const char* kColorCamera = R"({"fx": 613, "fy": 613, "cx": 320, "cy": 240})";
constexpr const char* kDepthCamera = R"({"fx": 390, "fy": 390, "cx": 320, "cy": 240})";

TEST(ForeignCalibrationTest, AnotherCameraForDepthIsUnknownUnlessItIsTheSame) {
  const TempFolder folder;
  const cv::Size depth(320, 240);
  const auto find = [&](const cv::Size& depth_size) {
    return FindForeignCalibration(folder.path(), kSize, depth_size).value();
  };
  WriteWholeFile(folder / "color_intrinsics.json", std::string_view(kColorCamera));
  EXPECT_FALSE(find(kSize).camera.depth_camera_unknown);
  EXPECT_TRUE(find(depth).camera.depth_camera_unknown) << "of another size";
  WriteWholeFile(folder / "depth_intrinsics.json", std::string_view(kColorCamera));
  EXPECT_FALSE(find(kSize).camera.depth_camera_unknown) << "registered";
  WriteWholeFile(folder / "depth_intrinsics.json", std::string_view(kDepthCamera));
  const ForeignCalibration both = find(kSize);
  EXPECT_EQ(both.camera.color.fx, 613);
  EXPECT_EQ(both.depth_file, "depth_intrinsics.json");
  EXPECT_TRUE(both.camera.depth_camera_unknown);
  EXPECT_THAT(EnglishTexts(both.camera.warnings),
              Contains(AllOf(HasSubstr("color_intrinsics.json"), HasSubstr("depth_intrinsics.json"),
                             HasSubstr("T_color_depth"))));
  fs::remove(folder / "color_intrinsics.json");
  EXPECT_EQ(find(kSize).camera.color.fx, 390) << "colour in the depth camera's view";
  WriteWholeFile(folder / "depth_intrinsics.json",
                 std::string_view(R"({"fx": 195, "fy": 195, "cx": 160, "cy": 120})"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)find(depth); }),
              AllOf(HasSubstr("depth_intrinsics.json"), HasSubstr("depth camera only")));
}

TEST(ForeignCalibrationTest, LargeAndUnreadableFilesAreNoCalibration) {
  const TempFolder folder;
  WriteWholeFile(folder / "camera.json", std::string_view(kColorCamera));
  for (const char* name : {"annotations.json", "transforms.json"})
    WriteWholeFile(folder / name, "{\"poses\": \"" + std::string(100'000, 'x') + "\"}");
  fs::create_symlink("nowhere", folder / "broken.json");
  EXPECT_EQ(FindForeignCalibration(folder.path(), kSize, kSize).value().camera.color.fx, 613);
  fs::remove(folder / "camera.json");
  EXPECT_FALSE(FindForeignCalibration(folder.path(), kSize, kSize));
}

TEST(ImageFolderTest, TwoCamerasOfDifferentFocalLengthsReachTheFrames) {
  const TempFolder folder;
  WriteImages(folder / "color", folder / "depth", "{}.png", "{}.png", 0, 3, 640, 480);
  WriteWholeFile(folder / "color_intrinsics.json", std::string_view(kColorCamera));
  WriteWholeFile(folder / "depth_intrinsics.json", std::string_view(kDepthCamera));
  const auto recording = OpenImported(folder.path());
  EXPECT_TRUE(recording->info().depth_camera_unknown) << "flat depth shows no edge";
  EXPECT_TRUE(recording->facts().camera.depth_camera_unknown);
  EXPECT_THAT(EnglishTexts(recording->info().warnings),
              Contains(HasSubstr("depth_intrinsics.json")));
}

TEST(ImageFolderTest, StampsBehindOtherTextAreTakenAsSuch) {
  for (const auto& [color, depth] :
       {std::pair{"rgb_13050311{:02}.175304.png", "depth_13050311{:02}.180304.png"},
        {"rgb13050311{:02}.175304.png", "d13050311{:02}.180304.png"},
        {"cam-1700000000{:02}0000000.png", "cam-1700000000{:02}5000000.png"}}) {
    const TempFolder folder;
    WriteImages(folder / "rgb", folder / "depth", color, depth, 3, 4);
    WriteWholeFile(folder / "camera.json",
                   std::string_view(R"({"fx": 60, "fy": 60, "cx": 32, "cy": 24})"));
    const auto recording = OpenImported(folder.path());
    EXPECT_EQ(recording->info().num_frames, 4) << color;
    const Frame first = recording->Next().value();
    EXPECT_NEAR(first.depth_time_s - first.color_time_s, 0.005, 1e-6) << color;
  }
}

TEST(ImageFolderTest, NumbersWithAPointAreNoStamps) {
  for (const char* name : {"cam1.{:04}.png", "frame.{:04}.png"}) {
    const TempFolder folder;
    WriteImages(folder / "rgb", folder / "depth", name, name, 0, 4);
    WriteWholeFile(folder / "camera.json",
                   std::string_view(R"({"fx": 60, "fy": 60, "cx": 32, "cy": 24})"));
    EXPECT_THAT(EnglishTexts(OpenImported(folder.path())->info().warnings),
                Contains(HasSubstr("no time stamps")))
        << name;
  }
}

TEST(ImageFolderTest, NumbersThatAreShiftedByOneAreNamed) {
  const TempFolder folder;
  WriteImages(folder / "rgb", folder / "depth", "{}.png", "{}.png", 0, 4);
  WriteWholeFile(folder / "camera.json",
                 std::string_view(R"({"fx": 60, "fy": 60, "cx": 32, "cy": 24})"));
  const auto warnings = [&] { return EnglishTexts(OpenImported(folder.path())->info().warnings); };
  EXPECT_THAT(warnings(), ::testing::Not(Contains(HasSubstr("numbered from"))));
  fs::rename(folder / "rgb/0.png", folder / "rgb/4.png");
  EXPECT_THAT(warnings(), Contains(HasSubstr("numbered from 1, the depth images from 0")));
}

TEST(ImageFolderTest, EndingsInCapitalsAreImages) {
  const TempFolder folder;
  WriteImages(folder / "rgb", folder / "depth", "{}.PNG", "{}.PNG", 0, 3);
  WriteWholeFile(folder / "camera.json",
                 std::string_view(R"({"fx": 60, "fy": 60, "cx": 32, "cy": 24})"));
  EXPECT_EQ(OpenImported(folder.path())->info().num_frames, 3);
}

TEST(ImageFolderTest, AFolderWithAPackedBagIsNamedWithTheCommand) {
  const TempFolder folder;
  WriteWholeFile(folder / "metadata.yaml", std::string_view("rosbag2_bagfile_information:\n"));
  WriteWholeFile(folder / "sweep_0.db3.zstd", std::string_view("x"));
  EXPECT_THAT(MessageOf<DataError>([&] { RefuseUnreadFormat(folder.path()); }),
              AllOf(HasSubstr("sweep_0.db3.zstd"), HasSubstr("zstd -d")));
  RefuseUnreadFormat(folder / "metadata.yaml");
}

TEST(ForeignCalibrationTest, TwoCamerasThatDifferAreRefused) {
  const TempFolder folder;
  WriteWholeFile(folder / "a.json",
                 std::string_view(R"({"fx": 600, "fy": 600, "cx": 320, "cy": 240})"));
  WriteWholeFile(folder / "b.json",
                 std::string_view(R"({"fx": 500, "fy": 500, "cx": 320, "cy": 240})"));
  EXPECT_THAT(
      MessageOf<DataError>([&] { (void)FindForeignCalibration(folder.path(), kSize, kSize); }),
      AllOf(HasSubstr("a.json"), HasSubstr("b.json")));
  fs::rename(folder / "a.json", folder / "rgb.json");
  EXPECT_EQ(FindForeignCalibration(folder.path(), kSize, kSize).value().camera.color.fx, 600);
}

TEST(ForeignCalibrationTest, FiveHundredDamagedTextsAreReadOrRefused) {
  std::mt19937 random(3);
  const std::array<std::pair<std::string, std::string>, 3> good = {
      {{kOpen3d, "a.json"},
       {"Camera.fx: 517.3\nCamera.fy: 516.5\nCamera.cx: 318.6\nCamera.cy: 255.3\n", "a.yaml"},
       {"585.5 0 320\n0 586 240\n0 0 1\n", "camera.txt"}}};
  for (int i = 0; i < 500; ++i) {
    auto [text, name] = good[static_cast<std::size_t>(i) % good.size()];
    for (int change = 0; change < 3; ++change)
      text[random() % text.size()] = static_cast<char>(random() % 128);
    try {
      (void)ParseForeignCalibration(text, name, 640, 480);
    } catch (const DataError& error) {
      EXPECT_STRNE(error.what(), "");
    }
  }
}

TEST(ForeignCalibrationTest, ATumFolderWithoutCameraYamlUsesItAndSaysSo) {
  const TempFolder folder;
  WriteImages(folder / "rgb", folder / "depth", "{}.png", "{}.png", 0, 3, 640, 480);
  std::string list;
  for (int i = 0; i < 3; ++i) list += fmt::format("{}.{:03} rgb/{}.png\n", 1, 33 * i, i);
  WriteWholeFile(folder / "rgb.txt", list);
  std::string depth = list;
  for (std::size_t at = 0; (at = depth.find("rgb/", at)) != std::string::npos;)
    depth.replace(at, 3, "depth");
  WriteWholeFile(folder / "depth.txt", depth);
  WriteWholeFile(folder / "camera_intrinsic.json", std::string_view(kOpen3d));
  const auto recording = OpenTumRecording(folder.path());
  EXPECT_EQ(recording->info().intrinsics.fx, 610.5);
  EXPECT_FALSE(recording->info().intrinsics_assumed);
  EXPECT_THAT(EnglishTexts(recording->info().warnings),
              Contains(HasSubstr("camera_intrinsic.json")));
}

}  // namespace
}  // namespace plumb
