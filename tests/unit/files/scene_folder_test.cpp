// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/scene_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <set>
#include <string>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "daemon/files/stored_scene.hpp"
#include "daemon/files/trajectory_file.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/files/small_output.hpp"
#include "words/reconstruction.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::PoseAt;
using testing::SmallScene;
using testing::TempFolder;

/// A written scene that a test then damages.
class SceneFolderTest : public ::testing::Test {
 protected:
  void SetUp() override { WriteScene(SmallScene(), scene_); }

  [[nodiscard]] std::string Refusal(const SceneParts& parts = {.mesh = true}) const {
    return MessageOf<DataError>([&] { (void)ReadScene(scene_, parts); });
  }

  /// Refusal after one change of scene.json.
  template <typename Change>
  [[nodiscard]] std::string RefusalWith(const Change& change) const {
    auto json = nlohmann::json::parse(SceneJson(SmallScene()));
    change(json);
    WriteWholeFile(scene_ / "scene.json", json.dump());
    return Refusal();
  }

  void Truncate(const char* name) const {
    fs::resize_file(scene_ / name, fs::file_size(scene_ / name) - 3);
  }

  TempFolder folder_;
  fs::path scene_ = folder_ / "scene";
};

Scene SceneWithSensitivity() {
  Scene scene = SmallScene();
  scene.sensitivity = testing::SmallSensitivity();
  return scene;
}

TEST_F(SceneFolderTest, RefusesAFileOfAnotherScene) {
  Scene other = SceneWithSensitivity();
  other.sensitivity->covariance *= 0.25;  // Would narrow the intervals without a word.
  other.height_map->z[0] += 0.001F;
  other.cloud.points[0].x() += 0.001F;
  other.mesh.vertices[0].x() += 0.001F;
  for (StampedPose& pose : other.keyframes) pose.T_world_camera.translation().x() += 0.001;
  for (StampedPose& pose : other.trajectory) pose.T_world_camera.translation().x() += 0.001;
  WriteScene(other, folder_ / "other");
  for (const char* name : {"sensitivity.json", "heightmap.tiff", "cloud.ply", "mesh.ply",
                           "trajectory.txt", "trajectory_all.txt"}) {
    WriteScene(SceneWithSensitivity(), scene_);
    EXPECT_NO_THROW((void)ReadScene(scene_, {.mesh = true})) << name;
    fs::copy_file(folder_ / "other" / name, scene_ / name, fs::copy_options::overwrite_existing);
    EXPECT_THAT(Refusal(), AllOf(HasSubstr(name), HasSubstr("its checksum is another"))) << name;
  }
}

TEST_F(SceneFolderTest, RefusesWithoutAFileThatItStatesOrWithOneThatItDoesNot) {
  WriteScene(SceneWithSensitivity(), scene_);
  fs::rename(scene_ / "sensitivity.json", folder_ / "sensitivity.json");
  EXPECT_THAT(Refusal(), HasSubstr("sensitivity.json is missing, scene.json states it"));
  WriteScene(SmallScene(), scene_);
  EXPECT_NO_THROW((void)ReadScene(scene_));
  fs::rename(folder_ / "sensitivity.json", scene_ / "sensitivity.json");
  EXPECT_THAT(Refusal(), HasSubstr("not one of the files that scene.json states"));
}

TEST_F(SceneFolderTest, ReadsASceneOfBeforeWhichStatesNoSums) {
  WriteWholeFile(scene_ / "scene.json", SceneJson(SmallScene()));
  EXPECT_NO_THROW((void)ReadScene(scene_, {.mesh = true}));
}

TEST_F(SceneFolderTest, GivesBackAPlanningCt) {
  Scene scene = SmallScene();
  scene.frame = SceneFrame::kIec;
  scene.markers.clear();
  scene.keyframes.clear();
  scene.trajectory.clear();
  PlanningSource& planning = scene.planning.emplace();
  planning.roi = "BODY";
  planning.posture = PatientPosture::kFeetFirstProne;
  planning.isocentre_mm = {72.53, -304.345, -9.309};
  planning.plan_uid = "1.2.3";
  planning.slices = 98;
  planning.slice_spacing_m = 0.003;
  planning.support_m = -0.17;
  WriteScene(scene, scene_);
  EXPECT_EQ(nlohmann::json::parse(SceneJson(scene)).at("source"), "dicom");
  const Scene read = ReadScene(scene_);
  EXPECT_EQ(read.frame, SceneFrame::kIec);
  ASSERT_TRUE(read.planning);
  EXPECT_EQ(read.planning->roi, "BODY");
  EXPECT_EQ(read.planning->posture, PatientPosture::kFeetFirstProne);
  EXPECT_EQ(read.planning->isocentre_mm, scene.planning->isocentre_mm);
  EXPECT_EQ(read.planning->plan_uid, "1.2.3");
  EXPECT_EQ(read.planning->slices, 98);
  EXPECT_EQ(read.planning->support_m, -0.17);
  EXPECT_FALSE(read.planning->skin_threshold_hu) << "a contour";
  scene.planning->skin_threshold_hu = -350;
  WriteScene(scene, scene_);
  EXPECT_EQ(ReadScene(scene_).planning->skin_threshold_hu, -350);
  EXPECT_EQ(ReadScene(scene_).planning->surface.clothing_u95_m, 0) << "nothing is stated";
  scene.planning->surface = {.clothing_u95_m = 0.03, .ct_breathing_u95_m = 0.004};
  WriteScene(scene, scene_);
  EXPECT_EQ(ReadScene(scene_).planning->surface.clothing_u95_m, 0.03);
  EXPECT_EQ(ReadScene(scene_).planning->surface.ct_breathing_u95_m, 0.004);
  for (const double wrong : {-0.001, 0.0301}) {
    scene.planning->surface = {.ct_breathing_u95_m = wrong};
    WriteScene(scene, scene_);
    EXPECT_THAT(Refusal(), HasSubstr("ct_breathing_u95_m")) << wrong;
    scene.planning->surface = {.clothing_u95_m = wrong};
    WriteScene(scene, scene_);
    EXPECT_THAT(Refusal(), HasSubstr("clothing_u95_m")) << wrong;
  }
  scene.planning->surface = {};
  scene.planning->skin_threshold_hu = -2001;
  WriteScene(scene, scene_);
  EXPECT_THAT(Refusal(), HasSubstr("skin_threshold_hu"));
  EXPECT_EQ(nlohmann::json::parse(SceneJson(SmallScene())).count("source"), 0U);
}

TEST_F(SceneFolderTest, RefusesAPlanningCtThatIsHalfOfOne) {
  const std::string contradiction = "source, frame and planning contradict each other";
  EXPECT_THAT(RefusalWith([](auto& json) { json["source"] = "dicom"; }), HasSubstr(contradiction));
  EXPECT_THAT(RefusalWith([](auto& json) { json["frame"] = "iec"; }), HasSubstr(contradiction));
  EXPECT_THAT(RefusalWith([](auto& json) { json["source"] = "fax"; }), HasSubstr("source"));
}

TEST_F(SceneFolderTest, GivesBackWhatWasWritten) {
  const Scene read = ReadScene(scene_, {.mesh = true});
  const Scene scene = SmallScene();
  EXPECT_EQ(read.preset, scene.preset);
  EXPECT_EQ(read.frame, scene.frame);
  EXPECT_EQ(read.room_markers.dictionary, scene.room_markers.dictionary);
  EXPECT_EQ(read.room_markers.length_m, scene.room_markers.length_m);
  EXPECT_EQ(read.room_markers.reference, scene.room_markers.reference);
  ASSERT_EQ(read.markers.size(), 2U);
  for (const auto& [id, marker] : scene.markers) {
    EXPECT_EQ(read.markers.at(id).corners, marker.corners) << id;  // bit for bit
    EXPECT_EQ(read.markers.at(id).num_views, marker.num_views);
    EXPECT_EQ(read.markers.at(id).sigma_m, marker.sigma_m);
  }
  ASSERT_EQ(read.keyframes.size(), 2U);
  ASSERT_EQ(read.trajectory.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read.trajectory[i].time_s, scene.trajectory[i].time_s);
    // Nine decimals: half a nanometre in the translation, a few nanoradians in the rotation.
    EXPECT_LT((read.trajectory[i].T_world_camera.translation() -
               scene.trajectory[i].T_world_camera.translation())
                  .norm(),
              1e-9);
    EXPECT_LT(RotationAngle(read.trajectory[i].T_world_camera.inverse() *
                            scene.trajectory[i].T_world_camera),
              1e-8);
  }
  EXPECT_EQ(read.frames_total, 5);
  EXPECT_EQ(read.frames_tracked, 3);
  EXPECT_EQ(read.frames_dropped, 1);
  EXPECT_EQ(read.frames_fewer_keypoints, 2);
  EXPECT_EQ(read.longest_lost_s, 0.25);
  ASSERT_TRUE(read.breathing);
  EXPECT_EQ(read.breathing->amplitude_m, 0.004);
  EXPECT_EQ(read.breathing->sigma_m, 0.0005);
  EXPECT_EQ(read.breathing->period_s, 3.5);
  EXPECT_EQ(read.breathing->limit_m, 0.0015);
  EXPECT_EQ(read.cloud.points, scene.cloud.points);
  EXPECT_EQ(read.cloud.normals, scene.cloud.normals);
  EXPECT_EQ(read.cloud.colors, scene.cloud.colors);
  ASSERT_TRUE(read.height_map);
  EXPECT_EQ(read.height_map->grid, scene.height_map->grid);
  EXPECT_EQ(read.height_map->at(0, 0), 0.01F);
  EXPECT_EQ(read.height_map->at(1, 2), -0.02F);
  EXPECT_TRUE(std::isnan(read.height_map->at(2, 6)));
  EXPECT_EQ(read.mesh.triangles, scene.mesh.triangles);
  EXPECT_EQ(read.calibration, scene.calibration);
  EXPECT_EQ(read.calibration_sigma, scene.calibration_sigma);
  EXPECT_EQ(read.calibration_prior_sigma, scene.calibration_prior_sigma);
  EXPECT_EQ(read.timings_s, scene.timings_s);
  EXPECT_EQ(read.warnings, scene.warnings);
}

TEST_F(SceneFolderTest, HoldsTheKeysOfTheContract) {
  const auto json = nlohmann::json::parse(ReadTextFile(scene_ / "scene.json", 1 << 20));
  EXPECT_EQ(json.at("format"), 1);
  EXPECT_EQ(json.at("preset"), "paper");
  EXPECT_EQ(json.at("frame"), "reference_marker");
  EXPECT_EQ(json.at("markers").at("100").size(), 4U);
  EXPECT_EQ(json.at("markers").at("100").at(2).at(0), 1.0 / 3.0);
  EXPECT_EQ(json.at("marker_views").at("11"), 9);
  EXPECT_EQ(json.at("heightmap").at("x_min"), -0.1);
  EXPECT_EQ(json.at("heightmap").at("y_min"), -0.2);
  EXPECT_EQ(json.at("heightmap").at("step"), 0.0015);
  EXPECT_EQ(json.at("heightmap").at("width"), 7);
  EXPECT_EQ(json.at("heightmap").at("height"), 3);
  EXPECT_EQ(json.at("keyframes"), 2);
  EXPECT_EQ(json.at("frames").at("total"), 5);
  EXPECT_EQ(json.at("calibration").at("depth_scale"), 1.00123);
  EXPECT_EQ(json.at("calibration_sigma").at("depth_scale"), 0.00021);
  EXPECT_EQ(json.at("calibration_prior_sigma").at("depth_scale"), 0.01);
  EXPECT_EQ(json.at("timings_s").at("clouds"), 0.5);
  EXPECT_EQ(json.at("warnings").at(0), "depth is a little short");
  EXPECT_EQ(json.at("warning_messages").at(0).at("id"), "text.verbatim");
}

TEST_F(SceneFolderTest, SameSceneSameBytes) {
  WriteScene(SmallScene(), folder_ / "again");
  for (const fs::directory_entry& entry : fs::directory_iterator(scene_)) {
    const std::string name = entry.path().filename().string();
    EXPECT_EQ(ReadWholeFile(entry.path(), 1 << 20),
              ReadWholeFile(folder_ / "again" / name, 1 << 20))
        << name;
  }
}

TEST_F(SceneFolderTest, ASceneWithoutMarkersHasNoHeightMap) {
  Scene scene = SmallScene();
  scene.frame = SceneFrame::kFirstKeyframe;
  scene.room_markers.reference.reset();
  scene.markers.clear();
  scene.height_map.reset();
  scene.mesh = {};
  WriteScene(scene, scene_);
  EXPECT_FALSE(fs::exists(scene_ / "heightmap.tiff"));
  EXPECT_TRUE(nlohmann::json::parse(ReadTextFile(scene_ / "scene.json", 1 << 20))
                  .at("heightmap")
                  .is_null());
  const Scene read = ReadScene(scene_, {.mesh = true});
  EXPECT_EQ(read.frame, SceneFrame::kFirstKeyframe);
  EXPECT_FALSE(read.height_map);
  EXPECT_FALSE(read.room_markers.reference);
  EXPECT_TRUE(read.mesh.triangles.empty());
}

TEST_F(SceneFolderTest, TrajectoryIsTumFormatWithSixDecimalsOfTime) {
  Scene scene = SmallScene();
  scene.trajectory = {{1700120000.0561461, Pose::Identity()}};
  WriteScene(scene, scene_);
  EXPECT_THAT(ReadTextFile(scene_ / "trajectory_all.txt", 1 << 20),
              HasSubstr("\n1700120000.056146 0.000000000 0.000000000 0.000000000 0.000000000 "
                        "0.000000000 0.000000000 1.000000000\n"));
}

TEST_F(SceneFolderTest, AnotherProgramsSceneWithOnlyTheContractsKeysIsRead) {
  auto json = nlohmann::json::parse(SceneJson(SmallScene()));
  for (const char* key : {"marker_dictionary", "marker_length_m", "reference_marker",
                          "marker_sigma_m", "longest_lost_s", "breathing"})
    json.erase(key);
  json["frames"].erase("fewer_keypoints");
  WriteWholeFile(scene_ / "scene.json", json.dump());
  EXPECT_EQ(ReadScene(scene_).markers.size(), 2U);
  EXPECT_FALSE(ReadScene(scene_).breathing);
  EXPECT_EQ(ReadScene(scene_).frames_fewer_keypoints, 0);
}

TEST_F(SceneFolderTest, BreathingThatNobodyCanHaveIsRefused) {
  auto json = nlohmann::json::parse(SceneJson(SmallScene()));
  for (const char* key : {"amplitude_m", "sigma_m", "period_s", "limit_m"}) {
    auto bad = json;
    bad["breathing"][key] = -1e-9;
    EXPECT_THROW((void)ParseSceneJson(bad.dump(), "scene.json"), DataError) << key;
    bad["breathing"].erase(key);
    EXPECT_THROW((void)ParseSceneJson(bad.dump(), "scene.json"), DataError) << key;
  }
}

TEST_F(SceneFolderTest, ASweepOfBeforeTheClassesIsOfStructuredLight) {
  auto json = nlohmann::ordered_json::parse(SceneJson(SmallScene()));
  json["depth_sensor"] = nullptr;  // as of what no depth camera made
  EXPECT_EQ(ParseSceneJson(json.dump(), "scene.json").scene.depth_sensor, std::nullopt);
  json.erase("depth_sensor");
  EXPECT_EQ(ParseSceneJson(json.dump(), "scene.json").scene.depth_sensor,
            DepthSensor::kStructuredLight);
}

TEST_F(SceneFolderTest, WarningsKeepTheirMessages) {
  Scene scene = SmallScene();
  scene.warnings = {say::reconstruction::NoMarker(), say::reconstruction::NoImage(1.57)};
  auto json = nlohmann::ordered_json::parse(SceneJson(scene));
  EXPECT_EQ(ParseSceneJson(json.dump(), "scene.json").scene.warnings, scene.warnings);
  json.erase("warning_messages");  // as 0.2.0 wrote it
  const std::vector<Message> old = ParseSceneJson(json.dump(), "scene.json").scene.warnings;
  ASSERT_EQ(old.size(), 2U);
  EXPECT_FALSE(old[1].Is(say::reconstruction::kNoImage));
  EXPECT_EQ(EnglishTexts(old), EnglishTexts(scene.warnings));
}

TEST_F(SceneFolderTest, WarningsInAnyEncodingAreWritten) {
  Scene scene = SmallScene();
  scene.warnings = {Message::Verbatim("file \xff\xfe")};
  WriteScene(scene, scene_);
  EXPECT_EQ(ReadScene(scene_).warnings.size(), 1U);
}

TEST_F(SceneFolderTest, WhatIsNotFiniteIsNeverWritten) {
  Scene scene = SmallScene();
  scene.keyframes[1].T_world_camera.translation().x() = std::nan("");
  EXPECT_THROW(WriteScene(scene, folder_ / "nan"), std::invalid_argument);
  scene = SmallScene();
  scene.markers[11].corners[0].x() = std::nan("");
  EXPECT_THROW(WriteScene(scene, folder_ / "nan"), std::invalid_argument);
  EXPECT_FALSE(fs::exists(folder_ / "nan"));
}

// The limit falls into another of the files each time.
TEST_F(SceneFolderTest, AFullDiskKeepsTheOldSceneAndLeavesNothingElse) {
  const std::string before = ReadTextFile(scene_ / "scene.json", 1 << 20);
  for (const unsigned long max_bytes : {0UL, 150UL, 300UL, 350UL}) {
    const auto outcome =
        testing::WriteOnFullDisk(max_bytes, [&] { WriteScene(SmallScene(), scene_); });
    EXPECT_EQ(outcome, testing::WriteOutcome::kIoError) << max_bytes;
    EXPECT_EQ(ReadTextFile(scene_ / "scene.json", 1 << 20), before);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 1)
        << max_bytes;
    EXPECT_EQ(ReadScene(scene_, {.mesh = true}).cloud.size(), 2U);
  }
  EXPECT_EQ(testing::WriteOnFullDisk(100'000, [&] { WriteScene(SmallScene(), scene_); }),
            testing::WriteOutcome::kDone);
}

// ---- bad input

TEST_F(SceneFolderTest, MissingFoldersAndFilesAreNamed) {
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadScene(folder_ / "none"); }),
              AllOf(HasSubstr("none"), HasSubstr("is missing")));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadScene(folder_.path()); }),
              HasSubstr("holds no scene.json"));
  fs::remove(scene_ / "heightmap.tiff");
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("heightmap.tiff"), HasSubstr("missing")));
  fs::remove(scene_ / "cloud.ply");
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("cloud.ply"), HasSubstr("missing")));
  fs::remove(scene_ / "trajectory.txt");
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("trajectory.txt"), HasSubstr("missing")));
}

TEST_F(SceneFolderTest, ANewerFormatIsNamed) {
  EXPECT_THAT(RefusalWith([](auto& json) { json["format"] = 2; }),
              AllOf(HasSubstr("scene.json"), HasSubstr("format 2"), HasSubstr("reads format 1"),
                    HasSubstr("update")));
  EXPECT_THAT(RefusalWith([](auto& json) { json["format"] = 0; }),
              HasSubstr("has format 0, this version reads format 1"));
  EXPECT_THAT(RefusalWith([](auto& json) { json["format"] = "1"; }),
              HasSubstr("format is \"1\", expected a whole number"));
  EXPECT_THAT(RefusalWith([](auto& json) { json.erase("format"); }),
              HasSubstr("format is missing"));
}

TEST_F(SceneFolderTest, TruncatedFilesAreNamed) {
  Truncate("mesh.ply");
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("mesh.ply"), HasSubstr("truncated")));
  EXPECT_EQ(ReadScene(scene_).keyframes.size(),
            2U);  // who does not ask for the mesh does not read it
  fs::resize_file(scene_ / "heightmap.tiff", fs::file_size(scene_ / "heightmap.tiff") / 2);
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("heightmap.tiff"), HasSubstr("truncated")));
  Truncate("cloud.ply");
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("cloud.ply"), HasSubstr("truncated")));
  Truncate("scene.json");
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("scene.json"), HasSubstr("not valid JSON")));
}

TEST_F(SceneFolderTest, ATruncatedTrajectoryIsNamed) {
  Truncate("trajectory.txt");  // a pose without its last digits still parses: the count of lines is
                               // right, the number is not
  fs::resize_file(scene_ / "trajectory.txt", fs::file_size(scene_ / "trajectory.txt") - 20);
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("trajectory.txt line 3"), HasSubstr("8 finite numbers")));
}

TEST_F(SceneFolderTest, NanPosesAreNamed) {
  WriteWholeFile(scene_ / "trajectory.txt",
                 std::string_view("1.0 0 0 0 0 0 0 1\n2.0 nan 0 0 0 0 0 1\n"));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("trajectory.txt line 2"), HasSubstr("finite")));
  WriteWholeFile(scene_ / "trajectory.txt",
                 std::string_view("1.0 0 0 0 0 0 0 0\n2.0 0 0 0 0 0 0 1\n"));
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("line 1"), HasSubstr("quaternion of length 0")));
  WriteWholeFile(scene_ / "trajectory.txt",
                 std::string_view("2.0 0 0 0 0 0 0 1\n2.0 0 0 0 0 0 0 1\n"));
  EXPECT_THAT(Refusal(), HasSubstr("not later"));
  WriteWholeFile(scene_ / "trajectory.txt", std::string_view("2.0 0 0 0 0 0 0 1 5\n"));
  EXPECT_THAT(Refusal(), HasSubstr("8 finite numbers"));
}

TEST_F(SceneFolderTest, CornersThatAreNoNumbersAreNamed) {
  EXPECT_THAT(RefusalWith([](auto& json) { json["markers"]["11"][1][2] = nullptr; }),
              HasSubstr("scene.json: markers.11[1][2] is null, expected a number from"));
  EXPECT_THAT(RefusalWith([](auto& json) { json["markers"]["11"][1][2] = 1e30; }),
              HasSubstr("1e+30"));
  EXPECT_THAT(RefusalWith([](auto& json) { json["markers"]["11"].erase(0); }),
              HasSubstr("expected a list of 4"));
  EXPECT_THAT(RefusalWith([](auto& json) { json["markers"]["-3"] = json["markers"]["11"]; }),
              HasSubstr("markers.-3 is not named by an id from 0 to 65535"));
  EXPECT_THAT(RefusalWith([](auto& json) { json["marker_views"]["12"] = 3; }),
              HasSubstr("belongs to no marker"));
  EXPECT_THAT(RefusalWith([](auto& json) { json["markers"] = nlohmann::json::array(); }),
              HasSubstr("markers is [], expected an object"));
}

TEST_F(SceneFolderTest, SizesThatDisagreeAreNamed) {
  EXPECT_THAT(RefusalWith([](auto& json) { json["heightmap"]["width"] = 8; }),
              AllOf(HasSubstr("heightmap.tiff has 7x3"), HasSubstr("scene.json states 8x3")));
  EXPECT_THAT(RefusalWith([](auto& json) { json["keyframes"] = 3; }),
              AllOf(HasSubstr("2 poses"), HasSubstr("3 keyframes")));
}

TEST_F(SceneFolderTest, AbsurdNumbersAreNamed) {
  EXPECT_THAT(RefusalWith([](auto& json) { json["heightmap"]["width"] = 1000000; }),
              AllOf(HasSubstr("width"), HasSubstr("1000000")));
  EXPECT_THAT(RefusalWith([](auto& json) { json["heightmap"]["step"] = 0; }), HasSubstr("step"));
  EXPECT_THAT(RefusalWith([](auto& json) { json["heightmap"]["step"] = -0.0015; }),
              HasSubstr("step"));
  EXPECT_THAT(RefusalWith([](auto& json) { json["frames"]["total"] = -1; }),
              HasSubstr("frames.total"));
  EXPECT_THAT(RefusalWith([](auto& json) { json["frame"] = "moon"; }),
              HasSubstr("frame is \"moon\", expected one of reference_marker, first_keyframe"));
  EXPECT_THAT(RefusalWith([](auto& json) { json["marker_dictionary"] = "DICT_9X9"; }),
              HasSubstr("DICT_9X9"));
  EXPECT_THAT(RefusalWith([](auto& json) { json = nlohmann::json::array(); }),
              HasSubstr("scene.json is [], expected an object"));
  WriteWholeFile(scene_ / "scene.json", std::string(200'000, '['));
  EXPECT_THAT(Refusal(), HasSubstr("nested at most 32 deep"));
}

TEST_F(SceneFolderTest, InfiniteHeightsAreNamed) {
  cv::Mat values(3, 7, CV_32FC1, cv::Scalar(0.1));
  values.at<float>(1, 4) = std::numeric_limits<float>::infinity();
  WriteFloatTiff(scene_ / "heightmap.tiff", values);
  EXPECT_THAT(Refusal(), AllOf(HasSubstr("heightmap.tiff"), HasSubstr("row 1, column 4")));
}

TEST_F(SceneFolderTest, AFolderOfSomethingElseIsNotReplaced) {
  fs::create_directory(folder_ / "photos");
  WriteWholeFile(folder_ / "photos/a.jpg", std::string_view("x"));
  EXPECT_THROW(WriteScene(SmallScene(), folder_ / "photos"), IoError);
  EXPECT_TRUE(fs::exists(folder_ / "photos/a.jpg"));
}

}  // namespace
}  // namespace plumb
