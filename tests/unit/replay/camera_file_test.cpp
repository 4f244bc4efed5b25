// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/camera_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::MessageOf;
using ::testing::SizeIs;

constexpr const char* kGood =
    "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 517.3, 0., "
    "318.6, 0., 516.5, 255.3, 0., 0., 1. ]\n"
    "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n"
    "   data: [ 0.2624, -0.9531, -0.0054, 0.0026, 1.1633 ]\n"
    "depth_scale: 1000.\ndepth_registered: 1\nmarker_dictionary: "
    "\"DICT_ARUCO_MIP_36h12\"\nmarker_length: 1.04e-01\nreference_marker: 7\n";

/// The good file with one piece of text exchanged.
std::string With(std::string_view old_text, std::string_view new_text) {
  std::string text = kGood;
  const std::size_t at = text.find(old_text);
  EXPECT_NE(at, std::string::npos) << old_text;
  return text.replace(at, old_text.size(), new_text);
}

std::string Refusal(const std::string& text) {
  return MessageOf<DataError>([&] { (void)ParseCameraFile(text, "rec/camera.yaml"); });
}

TEST(CameraFileTest, ReadsEveryKey) {
  const CameraFile camera = ParseCameraFile(kGood, "camera.yaml");
  EXPECT_EQ(camera.color.width, 640);
  EXPECT_EQ(camera.color.height, 480);
  EXPECT_EQ(camera.color.fx, 517.3);
  EXPECT_EQ(camera.color.fy, 516.5);
  EXPECT_EQ(camera.color.cx, 318.6);
  EXPECT_EQ(camera.color.cy, 255.3);
  EXPECT_THAT(camera.color.distortion,
              ElementsAre(0.2624, -0.9531, -0.0054, 0.0026, 1.1633, 0, 0, 0));
  EXPECT_EQ(camera.depth_scale, 1000.0);
  EXPECT_FALSE(camera.depth_camera);
  EXPECT_EQ(camera.room_markers.dictionary, "DICT_ARUCO_MIP_36h12");
  EXPECT_EQ(camera.room_markers.length_m, 0.104);
  EXPECT_EQ(camera.room_markers.reference, 7);
  EXPECT_THAT(camera.warnings, IsEmpty());
}

TEST(CameraFileTest, AbsentKeysKeepTheirDefaults) {
  const CameraFile camera = ParseCameraFile(
      "image_width: 320\nimage_height: 240\ncamera_matrix: [ 262, 0, 159.5, 0, 262, 119.5, 0, 0, 1 "
      "]\n",
      "camera.yaml");
  EXPECT_EQ(camera.color.fx, 262.0);
  EXPECT_FALSE(camera.depth_scale) << "no unit is assumed here";
  EXPECT_FALSE(camera.room_markers.dictionary || camera.room_markers.length_m ||
               camera.room_markers.reference);
  EXPECT_FALSE(camera.depth_noise);
  EXPECT_THAT(camera.warnings, SizeIs(1));  // no lens
}

TEST(CameraFileTest, ZeroNegativeAndNonFiniteFocalLengthsAreNamed) {
  EXPECT_THAT(Refusal(With("517.3", "0.")), AllOf(HasSubstr("rec/camera.yaml: camera_matrix"),
                                                  HasSubstr("0 and 516.5"), HasSubstr("> 0")));
  EXPECT_THAT(Refusal(With("516.5", "-516.5")), HasSubstr("-516.5"));
  EXPECT_THAT(Refusal(With("517.3", ".Nan")), HasSubstr("finite"));
  EXPECT_THAT(Refusal(With("517.3", ".Inf")), HasSubstr("finite"));
}

TEST(CameraFileTest, IntrinsicsOfAnotherImageSizeAreNamed) {
  EXPECT_THAT(
      Refusal(With("image_width: 640\nimage_height: 480", "image_width: 320\nimage_height: 240")),
      AllOf(HasSubstr("does not fit an image of 320x240"), HasSubstr("another size")));
}

TEST(CameraFileTest, SizesOutOfRangeAreNamed) {
  EXPECT_THAT(Refusal(With("image_width: 640", "image_width: 0")), HasSubstr("0x480"));
  EXPECT_THAT(Refusal(With("image_height: 480", "image_height: 1000000000")),
              HasSubstr("640x1000000000"));
  EXPECT_THAT(Refusal(With("image_width: 640", "image_width: 640.5")), HasSubstr("whole number"));
  EXPECT_THAT(Refusal(With("image_width: 640", "image_width: \"wide\"")),
              HasSubstr("expected finite numbers"));
  EXPECT_THAT(Refusal(With("image_width: 640\n", "")), HasSubstr("image_width is missing"));
}

TEST(CameraFileTest, MatricesOfAnotherShapeAreNamed) {
  EXPECT_THAT(Refusal(With(", 0., 0., 1. ]", " ]")),
              AllOf(HasSubstr("camera_matrix"), HasSubstr("6 elements")));
  EXPECT_THAT(Refusal(With("0., 0., 1. ]", "0., 0., 2. ]")),
              HasSubstr("expected [fx 0 cx, 0 fy cy, 0 0 1]"));
  EXPECT_THAT(Refusal(With(", 1.1633 ]", ", 1.1633, 0.5 ]")),
              AllOf(HasSubstr("distortion_coefficients"), HasSubstr("6 elements")));
  EXPECT_EQ(ParseCameraFile(With(", 1.1633 ]", ", 1.1633, 0., 0., 0. ]"), "c").color.distortion[4],
            1.1633);
}

TEST(CameraFileTest, LensesThatCannotBeUndoneAreNamed) {
  EXPECT_THAT(Refusal(With("0.2624", "1e30")), HasSubstr("not a plausible lens"));
  EXPECT_THAT(Refusal(With("0.2624, -0.9531", "-2.5, 0.")),
              AllOf(HasSubstr("distortion_coefficients"), HasSubstr("cannot be undone")));
}

TEST(CameraFileTest, DepthScaleIsUnitsPerMetre) {
  EXPECT_THAT(Refusal(With("depth_scale: 1000.", "depth_scale: 0.")),
              AllOf(HasSubstr("depth_scale is 0"), HasSubstr("1000 for millimetres")));
  EXPECT_THAT(Refusal(With("depth_scale: 1000.", "depth_scale: 0.001")),
              HasSubstr("units per metre"));
  EXPECT_THAT(Refusal(With("depth_scale: 1000.", "depth_scale: -5000.")),
              HasSubstr("depth_scale is -5000"));
}

TEST(CameraFileTest, UnknownDictionaryIsNamedWithTheKnownOnes) {
  EXPECT_THAT(Refusal(With("DICT_ARUCO_MIP_36h12", "DICT_9X9_10")),
              AllOf(HasSubstr("marker_dictionary"), HasSubstr("DICT_9X9_10"),
                    HasSubstr("DICT_6X6_250"), HasSubstr("DICT_ARUCO_MIP_36h12")));
  EXPECT_THAT(Refusal(With("\"DICT_ARUCO_MIP_36h12\"", "5")),
              HasSubstr("is \"5\", expected one of"));
}

TEST(CameraFileTest, MarkerLengthAndIdOutOfRangeAreNamed) {
  EXPECT_THAT(Refusal(With("1.04e-01", "0.")),
              AllOf(HasSubstr("marker_length is 0 m"), HasSubstr("more than 0")));
  EXPECT_THAT(Refusal(With("1.04e-01", "-0.1")), HasSubstr("-0.1"));
  EXPECT_THAT(Refusal(With("1.04e-01", "104.")), HasSubstr("104 m"));
  EXPECT_THAT(Refusal(With("reference_marker: 7", "reference_marker: -1")),
              HasSubstr("reference_marker is -1"));
}

TEST(CameraFileTest, AKeyThatIsNotReadIsNamedWithTheNearestOne) {
  EXPECT_THAT(
      Refusal(With("depth_scale:", "depth_scales:")),
      AllOf(HasSubstr("rec/camera.yaml"), HasSubstr("'depth_scales'"), HasSubstr("'depth_scale'")));
  EXPECT_THAT(Refusal(With("marker_length:", "marker_lenght:")), HasSubstr("'marker_length'"));
  EXPECT_THAT(Refusal(With("marker_length:", "marker_size:")),
              AllOf(HasSubstr("unknown key"), HasSubstr("'marker_length'")));
  for (const char* of_others : {"depth_factor", "DepthMapFactor", "depth_units"})
    EXPECT_THAT(Refusal(With("depth_scale:", std::string(of_others) + ":")),
                AllOf(HasSubstr(of_others), HasSubstr("'depth_scale'")));
  EXPECT_THAT(Refusal(With("reference_marker:", "Reference_Marker:")),
              HasSubstr("'reference_marker'"));
}

TEST(CameraFileTest, WhatCalibratorsWriteBesideTheKeysIsLeftAlone) {
  for (const char* line :
       {"camera_name: rgb\n", "rectification_matrix: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n",
        "calibration_time: \"now\"\n", "avg_reprojection_error: 0.2\n", "sensor_serial: \"4711\"\n",
        "color_begin_us: 0\n"})
    EXPECT_EQ(ParseCameraFile(std::string(kGood) + line, "camera.yaml").color.fx, 517.3) << line;
}

TEST(CameraFileTest, TheLensModelIsReadOrRefusedByName) {
  for (const char* model : {"plumb_bob", "radtan", "brown_conrady"})
    EXPECT_EQ(
        ParseCameraFile(std::string(kGood) + "distortion_model: " + model + "\n", "c").color.fx,
        517.3);
  EXPECT_THAT(Refusal(std::string(kGood) + "distortion_model: thin_prism\n"),
              AllOf(HasSubstr("thin_prism"), HasSubstr("plumb_bob")));
}

constexpr const char* kLens = "0.2624, -0.9531, -0.0054, 0.0026, 1.1633";

TEST(CameraFileTest, ARationalLensHasEightCoefficients) {
  const std::string text = With(kLens, "0.51, -2.74, 0.0006, -0.0002, 1.64, 0.39, -2.55, 1.56");
  const auto lens = ElementsAre(0.51, -2.74, 0.0006, -0.0002, 1.64, 0.39, -2.55, 1.56);
  EXPECT_THAT(ParseCameraFile(text, "c").color.distortion, lens);
  EXPECT_THAT(
      ParseCameraFile(text + "distortion_model: rational_polynomial\n", "c").color.distortion,
      lens);
  EXPECT_THAT(Refusal(text + "distortion_model: plumb_bob\n"),
              AllOf(HasSubstr("distortion_model"), HasSubstr("which has 5 coefficients"),
                    HasSubstr("distortion_coefficients holds more")));
  // OpenCV's thin prism and tilt are zero, or are not read.
  const auto twelve = [](const char* last) {
    return With(kLens, std::string("0.5, -2.7, 0., 0., 1.6, 0.4, -2.5, 1.5, 0., 0., 0., ") + last);
  };
  EXPECT_EQ(ParseCameraFile(twelve("0."), "c").color.distortion[7], 1.5);
  EXPECT_THAT(Refusal(twelve("0.1")), HasSubstr("12 elements"));
}

TEST(CameraFileTest, NoLensMeansNoCoefficients) {
  for (const std::string model : {"none", "pinhole"}) {
    EXPECT_THAT(Refusal(std::string(kGood) + "distortion_model: " + model + "\n"),
                HasSubstr("which has 0 coefficients"));
    EXPECT_FALSE(
        HasLens(ParseCameraFile(
                    With(kLens, "0., 0., 0., 0., 0.") + "distortion_model: " + model + "\n", "c")
                    .color));
  }
}

TEST(CameraFileTest, AnEquidistantLensIsRead) {
  const std::string text = With(kLens, "-0.012, 0.031, -0.022, 0.004");
  for (const char* line : {"distortion_model: equidistant\n", "distortion_model: fisheye\n",
                           "distortion_model: kannala_brandt\n", "fisheye_model: 1\n"}) {
    const Intrinsics camera = ParseCameraFile(text + line, "c").color;
    // A point 35 deg from the axis, as cv::fisheye::projectPoints() places it.
    const double theta = 35.0 * 3.14159265358979 / 180.0, t2 = theta * theta;
    const double radius = theta * (1 + t2 * (-0.012 + t2 * (0.031 + t2 * (-0.022 + t2 * 0.004))));
    const Eigen::Vector2d pixel =
        Project(camera, {std::sin(theta) * 0.6, std::sin(theta) * 0.8, std::cos(theta)});
    EXPECT_NEAR(pixel.x(), 318.6 + 517.3 * radius * 0.6, 0.02) << line;
    EXPECT_NEAR(pixel.y(), 255.3 + 516.5 * radius * 0.8, 0.02) << line;
  }
  EXPECT_THAT(Refusal(std::string(kGood) + "distortion_model: equidistant\n"),
              AllOf(HasSubstr("5 elements"), HasSubstr("the 4 of an equidistant lens")));
  EXPECT_EQ(ParseCameraFile(text + "fisheye_model: 0\n", "c").color.distortion[1], 0.031);
}

TEST(CameraFileTest, SettingsOfOtherProgramsAreNamed) {
  EXPECT_THAT(Refusal("%YAML:1.0\n---\nCamera.type: \"PinHole\"\nCamera.fx: 517.3\n"),
              HasSubstr("ORB-SLAM"));
  EXPECT_THAT(Refusal("{\"width\": 640, \"height\": 480, \"intrinsic_matrix\": [525.0, 0, 0]}"),
              HasSubstr("Open3D"));
  EXPECT_THAT(Refusal("<?xml version=\"1.0\"?>\n<opencv_storage>\n"), HasSubstr("is XML"));
}

TEST(CameraFileTest, RegisteredMayBeTrueOrFalse) {
  EXPECT_FALSE(ParseCameraFile(With("depth_registered: 1", "depth_registered: true"), "c")
                   .depth_camera_unknown);
  EXPECT_TRUE(ParseCameraFile(With("depth_registered: 1", "depth_registered: false"), "c")
                  .depth_camera_unknown);
  EXPECT_THAT(Refusal(With("depth_registered: 1", "depth_registered: 2")),
              HasSubstr("expected 0 or 1"));
}

TEST(CameraFileTest, WhatIsNoYamlIsRefused) {
  EXPECT_THAT(Refusal(""), HasSubstr("rec/camera.yaml"));
  EXPECT_THAT(Refusal("just words"), HasSubstr("rec/camera.yaml"));
  EXPECT_THAT(Refusal("%YAML:1.0\n---\na: [1, 2\nb: }"), HasSubstr("rec/camera.yaml"));
  EXPECT_THAT(Refusal(std::string("%YAML:1.0\n---\na: ") + '\0'), HasSubstr("zero bytes"));
  EXPECT_THAT(Refusal("%YAML:1.0\n---\na: " + std::string(30000, '[')), HasSubstr("nests deeper"));
  std::string dashes = "%YAML:1.0\n---\na:\n   ";
  for (int i = 0; i < 10000; ++i) dashes += "- ";
  EXPECT_THAT(Refusal(dashes), HasSubstr("nests deeper"));
  EXPECT_THAT(Refusal(std::string(70000, ' ')), HasSubstr("70000 bytes"));
}

TEST(CameraFileTest, ALineOfDashesInACommentIsNotNesting) {
  const std::string refusal = Refusal("%YAML:1.0\n---\n# ---------- camera ----------\na: 1\n");
  EXPECT_THAT(refusal, ::testing::Not(HasSubstr("nests")));
}

TEST(CameraFileTest, TextsThatParsersDoNotReturnFromAreRefused) {
  // Found by fuzzing: the reader of OpenCV 4.6 loops for ever on the first.
  for (const char* text : {"%YAML:1.0\n---%YAML:1.0\ni\n-m", "%YAML:1.0", "%", "---\n---\n---",
                           "a: &a [ *a ]\nimage_width: *a", "? {a: b}\n: -"})
    EXPECT_THAT(Refusal(text), HasSubstr("camera.yaml")) << text;
}

TEST(CameraFileTest, NumbersAsOpenCvWritesThem) {
  const CameraFile camera = ParseCameraFile(
      With("depth_scale: 1000.", "depth_scale: +5.0000000000000000e+03"), "camera.yaml");
  EXPECT_EQ(camera.depth_scale, 5000.0);
  EXPECT_THAT(Refusal(With("depth_scale: 1000.", "depth_scale: .Nan")),
              HasSubstr("expected finite numbers"));
  EXPECT_THAT(Refusal(With("depth_scale: 1000.", "depth_scale: 5000 mm")),
              HasSubstr("expected finite numbers"));
}

constexpr const char* kDepthCamera =
    "depth_registered: 0\ndepth_image_width: 320\ndepth_image_height: 240\n"
    "depth_camera_matrix: [ 290., 0., 158., 0., 291., 121., 0., 0., 1. "
    "]\ndepth_distortion_coefficients: [ 0., 0., 0., 0., 0. ]\n"
    "T_color_depth: [ 1., 0., 0., 0.025, 0., 1., 0., 0.001, 0., 0., 1., -0.002, 0., 0., 0., 1. ]";

TEST(CameraFileTest, ReadsTheDepthCamera) {
  const CameraFile camera =
      ParseCameraFile(With("depth_registered: 1", kDepthCamera), "camera.yaml");
  ASSERT_TRUE(camera.depth_camera);
  EXPECT_EQ(camera.depth_camera->intrinsics.width, 320);
  EXPECT_EQ(camera.depth_camera->intrinsics.fy, 291.0);
  EXPECT_TRUE(camera.depth_camera->T_color_depth.translation().isApprox(
      Eigen::Vector3d(0.025, 0.001, -0.002)));
}

TEST(CameraFileTest, UnregisteredDepthWithoutItsCameraIsUnknownWithAWarning) {
  const CameraFile camera =
      ParseCameraFile(With("depth_registered: 1", "depth_registered: 0"), "camera.yaml");
  EXPECT_FALSE(camera.depth_camera);
  EXPECT_TRUE(camera.depth_camera_unknown);
  ASSERT_THAT(camera.warnings, SizeIs(1));
  EXPECT_THAT(camera.warnings[0].English(), HasSubstr("searched for in the images"));
}

TEST(CameraFileTest, ADepthCameraNeedsTheWordWhetherItIsUsed) {
  const std::string stated = std::string(kDepthCamera).substr(std::string(kDepthCamera).find('\n'));
  EXPECT_THAT(Refusal(With("depth_registered: 1", stated)),
              AllOf(HasSubstr("T_color_depth"), HasSubstr("add depth_registered: 0")));
  EXPECT_THAT(Refusal(With("depth_registered: 1", "depth_image_width: 320")),
              HasSubstr("depth_image_width"));
  const CameraFile camera =
      ParseCameraFile(With("depth_registered: 1", "depth_registered: 1" + stated), "c");
  EXPECT_FALSE(camera.depth_camera || camera.depth_camera_unknown);
  ASSERT_THAT(camera.warnings, SizeIs(1));
  EXPECT_THAT(camera.warnings[0].English(), HasSubstr("are not used"));
}

TEST(CameraFileTest, AKeyThatIsThereTwiceIsRefused) {
  EXPECT_THAT(Refusal(std::string(kGood) + "depth_scale: 5000\n"),
              HasSubstr("the key 'depth_scale' twice"));
}

TEST(CameraFileTest, AnEquidistantLensNeedsItsCoefficients) {
  std::string text = kGood;
  const std::size_t lens = text.find("distortion_coefficients");
  text.erase(lens, text.find("depth_scale") - lens);
  EXPECT_THAT(ParseCameraFile(text, "c").warnings, SizeIs(1));
  for (const char* model : {"distortion_model: equidistant\n", "fisheye_model: 1\n"})
    EXPECT_THAT(Refusal(text + model), HasSubstr("distortion_coefficients is missing")) << model;
}

TEST(CameraFileTest, AnEquidistantLensOfTheDepthCameraIsRefused) {
  std::string text = With("0.2624, -0.9531, -0.0054, 0.0026, 1.1633", "-0.01, 0.03, 0., 0.") +
                     "distortion_model: equidistant\n";
  text.replace(text.find("depth_registered: 1"), 19, kDepthCamera);
  EXPECT_TRUE(ParseCameraFile(text, "c").depth_camera) << "five coefficients, all zero";
  const std::string five = "depth_distortion_coefficients: [ 0., 0., 0., 0., 0. ]";
  const auto with_lens = [&](const std::string& lens) {
    std::string other = text;
    return other.replace(other.find(five), five.size(), "depth_distortion_coefficients: " + lens);
  };
  EXPECT_TRUE(ParseCameraFile(with_lens("[ 0., 0., 0., 0. ]"), "c").depth_camera);
  EXPECT_THAT(Refusal(with_lens("[ 0.01, 0., 0., 0. ]")),
              AllOf(HasSubstr("depth_distortion_coefficients"), HasSubstr("equidistant")));
}

TEST(CameraFileTest, TextOfOtherEncodingsIsReadOrNamed) {
  EXPECT_EQ(ParseCameraFile(std::string("\xEF\xBB\xBF") + kGood, "c").color.fx, 517.3);
  for (const bool marked : {true, false}) {
    std::string wide = marked ? "\xFF\xFE" : "";
    for (const char* c = kGood; *c != 0; ++c) (wide += *c) += '\0';
    EXPECT_THAT(Refusal(wide), HasSubstr("UTF-16")) << marked;
  }
}

TEST(CameraFileTest, WhatTheWriterHadAssumedStaysAssumed) {
  const CameraFile camera = ParseCameraFile(
      std::string(kGood) + "assumed: [ camera_matrix, depth_registered ]\n", "camera.yaml");
  EXPECT_TRUE(camera.color_assumed && camera.depth_camera_estimated);
  EXPECT_FALSE(camera.depth_unit_assumed);
  ASSERT_THAT(camera.warnings, SizeIs(1));
  EXPECT_THAT(camera.warnings[0].English(), HasSubstr("camera_matrix, depth_registered"));
  StreamInfo info;
  TakeOver(camera, info);
  EXPECT_TRUE(info.intrinsics_assumed && info.depth_camera_estimated);
  EXPECT_FALSE(info.depth_unit_assumed);
  EXPECT_TRUE(
      ParseCameraFile(std::string(kGood) + "assumed: depth_scale\n", "c").depth_unit_assumed);
  EXPECT_THAT(Refusal(std::string(kGood) + "assumed: [ marker_length ]\n"),
              AllOf(HasSubstr("marker_length"), HasSubstr("depth_scale")));
}

TEST(CameraFileTest, ATransformThatIsNotRigidIsNamed) {
  std::string text = With("depth_registered: 1", kDepthCamera);
  text.replace(text.find("[ 1., 0., 0., 0.025"), 4, "[ 2.");
  EXPECT_THAT(Refusal(text), AllOf(HasSubstr("T_color_depth"), HasSubstr("rigid")));
  text = With("depth_registered: 1", kDepthCamera);
  text.replace(text.find("0.025"), 5, "25.00");
  EXPECT_THAT(Refusal(text), AllOf(HasSubstr("T_color_depth"), HasSubstr("metres")));
  EXPECT_THAT(Refusal(With("depth_registered: 1", "depth_registered: 2")),
              HasSubstr("expected 0 or 1"));
}

constexpr const char* kNoise =
    "reference_marker: 7\ndepth_noise:\n   constant_m: 0.0005\n   linear_m_per_m: 0.\n"
    "   quadratic_m_per_m2: 0.004\n   origin_m: 0.\n   grazing_m: 2e-4\n";

/// The good file with a depth noise, with one piece of its text exchanged.
std::string WithNoise(std::string_view old_text, std::string_view new_text) {
  std::string text = With("reference_marker: 7\n", kNoise);
  const std::size_t at = text.find(old_text, text.find("depth_noise"));
  EXPECT_NE(at, std::string::npos) << old_text;
  return text.replace(at, old_text.size(), new_text);
}

TEST(CameraFileTest, TheDepthNoiseIsReadAsItIsStated) {
  const DepthNoise expected = {.constant_m = 0.0005,
                               .linear_m_per_m = 0.0,
                               .quadratic_m_per_m2 = 0.004,
                               .origin_m = 0.0,
                               .grazing_m = 0.0002};
  EXPECT_EQ(ParseCameraFile(WithNoise("0.0005", "0.0005"), "c").depth_noise, expected);
  EXPECT_EQ(ParseCameraFile(With("reference_marker: 7",
                                 "depth_noise: {grazing_m: 0.0002, constant_m: 0.0005, origin_m: 0,"
                                 " quadratic_m_per_m2: 0.004, linear_m_per_m: 0}"),
                            "c")
                .depth_noise,
            expected);
}

TEST(CameraFileTest, TheClassOfTheDepthSensorBringsItsNoiseAndRange) {
  StreamInfo info;
  TakeOver(ParseCameraFile(kGood, "c"), info);
  EXPECT_EQ(info.depth_sensor, DepthSensor::kStructuredLight);
  const auto with = [](const std::string& keys) {
    StreamInfo taken;
    TakeOver(ParseCameraFile(With("reference_marker: 7", keys), "c"), taken);
    return taken;
  };
  info = with("depth_sensor: active_stereo");
  EXPECT_EQ(info.depth_sensor, DepthSensor::kActiveStereo);
  EXPECT_EQ(info.depth_noise, ClassOf(DepthSensor::kActiveStereo).noise);
  EXPECT_EQ(info.usable_depth, ClassOf(DepthSensor::kActiveStereo).range);
  // What the file states itself holds, in any order.
  info = with("depth_range: [0.07, 0.5]\ndepth_sensor: time_of_flight\n" +
              std::string(kNoise).substr(std::string(kNoise).find("depth_noise")));
  EXPECT_EQ(info.depth_sensor, DepthSensor::kTimeOfFlight);
  EXPECT_EQ(info.depth_noise.constant_m, 0.0005);
  EXPECT_EQ(info.usable_depth, (UsableDepth{.nearest_m = 0.07, .farthest_m = 0.5}));
}

TEST(CameraFileTest, AnotherClassOrRangeIsNamedWithWhatIsKnown) {
  EXPECT_THAT(Refusal(With("reference_marker: 7", "depth_sensor: stereo")),
              AllOf(HasSubstr("rec/camera.yaml: depth_sensor"), HasSubstr("stereo"),
                    HasSubstr("structured_light, active_stereo, time_of_flight, lidar")));
  for (const char* range : {"[0.5]", "[4, 0.3]", "[300, 4000]", "[0, 4]", "[0.3, 4, 5]"})
    EXPECT_THAT(Refusal(With("reference_marker: 7", std::string("depth_range: ") + range)),
                HasSubstr("rec/camera.yaml: depth_range"))
        << range;
}

TEST(CameraFileTest, ADepthNoiseThatIsNotWholeIsNamedWithItsKeys) {
  const auto keys = AllOf(HasSubstr("rec/camera.yaml: depth_noise"),
                          HasSubstr("constant_m, linear_m_per_m, quadratic_m_per_m2, origin_m, "
                                    "grazing_m"));
  EXPECT_THAT(Refusal(WithNoise("   origin_m: 0.\n", "")), keys);
  EXPECT_THAT(Refusal(WithNoise("origin_m", "orign_m")), keys);
  EXPECT_THAT(Refusal(WithNoise("   origin_m: 0.\n", "   origin_m: 0.\n   cubic: 0.\n")), keys);
  for (const char* other : {"0.0012", "[0.0012, 0, 0.0019, 0.4, 0.0001]", "{}", "kinect"})
    EXPECT_THAT(Refusal(With("reference_marker: 7", std::string("depth_noise: ") + other)), keys)
        << other;
}

TEST(CameraFileTest, ADepthNoiseThatIsImpossibleIsNamedWithWhatToDo) {
  EXPECT_THAT(Refusal(WithNoise("0.0005", "1.2")),
              AllOf(HasSubstr("rec/camera.yaml: depth_noise: constant_m is 1.2"),
                    HasSubstr("from -0.1 to 0.1"), HasSubstr("in metres"), HasSubstr("remove")));
  EXPECT_THAT(Refusal(WithNoise("0.0005", "-0.0005")), HasSubstr("falls to -0.0005 m"));
  EXPECT_THAT(Refusal(WithNoise("0.004", "-0.004")), HasSubstr("quadratic_m_per_m2 is -0.004"));
  EXPECT_THAT(Refusal(WithNoise("0.004", "0.2")), HasSubstr("at 1 m"));
  for (const char* hostile : {".Nan", ".Inf", "-.Inf", "1e999", "[1]", "{a: 1}", "\"many\"", ""})
    EXPECT_THAT(Refusal(WithNoise("0.0005", hostile)),
                AllOf(HasSubstr("depth_noise: constant_m"), HasSubstr("finite numbers")))
        << hostile;
}

}  // namespace
}  // namespace plumb
