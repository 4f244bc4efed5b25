// SPDX-License-Identifier: Apache-2.0
#include "daemon/result/result_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <set>
#include <string>
#include <vector>

#include "algo/base/errors.hpp"
#include "daemon/files/map_marks.hpp"
#include "daemon/files/ply_file.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/files/small_output.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Answer;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::kGrid;
using testing::MessageOf;
using testing::Slope;
using testing::TempFolder;

std::set<std::string> Names(const fs::path& folder) {
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    names.insert(entry.path().filename().string());
  return names;
}

TEST(ResultFolderTest, TheFieldIsAPlyThatOtherReadersTake) {
  const TempFolder folder;
  WriteResult(Answer(), {}, folder / "result");
  const PointCloud cloud = ReadCloudPly(folder / "result" / "deformation.ply");
  EXPECT_EQ(cloud.points, Answer().deformation->points);
  const auto bytes = ReadWholeFile(folder / "result" / "deformation.ply", 10'000);
  const std::size_t row = 6 * sizeof(float) + 1;
  ASSERT_GT(bytes.size(), 2 * row);
  std::array<float, 3> shift{};
  std::memcpy(shift.data(), bytes.data() + bytes.size() - 2 * row + 12, sizeof shift);
  EXPECT_EQ(shift, (std::array{0.01F, 0.02F, 0.03F}));
  EXPECT_EQ(bytes[bytes.size() - row - 1], 1);
  EXPECT_EQ(bytes.back(), 0);
}

TEST(ResultFolderTest, TheMarksNameTheGantryWhereTheRoomIsKnownAndNoSideWithoutAnAnswer) {
  const auto names = [](const Comparison& comparison) {
    std::vector<std::string> found;
    for (const MapMark& mark : MapMarks(comparison)) found.push_back(mark.name);
    return found;
  };
  Comparison comparison = Answer();
  comparison.body_parts.emplace();
  EXPECT_THAT(names(comparison), ElementsAre());
  comparison.body_parts->room = RoomWays{{1, 0}, {0, -1}};
  EXPECT_THAT(names(comparison), ElementsAre("GANTRY", "+X", "\u2212X"));
  comparison.body_parts->by_posture = true;
  comparison.body_parts->patient = PatientAxes{{1, 0}, {0, -1}};
  EXPECT_THAT(names(comparison), ElementsAre("GANTRY", "HEAD", "FEET", "LEFT", "RIGHT"));
  EXPECT_EQ(MapMarks(comparison)[0].toward, Eigen::Vector2d(1, 0));
  EXPECT_EQ(MapMarks(comparison)[4].toward, Eigen::Vector2d(0, 1)) << "right is opposite the left";
  const auto body = nlohmann::json::parse(ResultText(Stored(comparison))).at("body");
  EXPECT_EQ(body.at("gantry_xy"), (nlohmann::json{1.0, 0.0}));
  EXPECT_EQ(body.at("right_xy"), (nlohmann::json{0.0, -1.0}));
  comparison.verdict = Verdict::kNoAnswer;
  EXPECT_THAT(names(comparison), ElementsAre("GANTRY", "+X", "\u2212X"));
  comparison.verdict = Verdict::kMove;
  comparison.body_parts->room.reset();
  EXPECT_THAT(names(comparison), ElementsAre("HEAD", "FEET", "LEFT", "RIGHT"));
  EXPECT_FALSE(
      nlohmann::json::parse(ResultText(Stored(comparison))).at("body").contains("gantry_xy"));
}

TEST(ResultFolderTest, HoldsTheKeysOfTheContract) {
  const auto json = nlohmann::json::parse(ResultText(Stored(Answer())));
  EXPECT_EQ(json.at("format"), 1);
  EXPECT_EQ(json.at("verdict"), "move");
  EXPECT_EQ(json.at("preset"), "paper");
  EXPECT_TRUE(json.at("sensor_profiles").at("reference").is_null());
  EXPECT_EQ(json.at("sensor_profiles").at("current"), "unit 61, 3 sweeps");
  EXPECT_FALSE(json.at("version").get<std::string>().empty());
  EXPECT_EQ(json.at("reasons").at(0), "vertical is 9.0 mm off");
  const auto& alignment = json.at("alignment");
  EXPECT_EQ(alignment.at("T_reference_current").at(1).at(3),
            0.5);  // row-major: the translation is the last column
  EXPECT_EQ(alignment.at("T_reference_current").at(3), (nlohmann::json{0.0, 0.0, 0.0, 1.0}));
  EXPECT_EQ(alignment.at("stretch").at(0), (nlohmann::json{1.0, 0.125, 0.0}));
  EXPECT_EQ(alignment.at("rms_m"), 0.001);
  EXPECT_EQ(alignment.at("markers_used"), (nlohmann::json{3, 5, 8}));
  EXPECT_EQ(alignment.at("markers_rejected").at("7"), 0.012);
  const auto& motion = json.at("motion");
  EXPECT_EQ(motion.at("T").at(2).at(3), 3.0);
  EXPECT_EQ(motion.at("covariance").size(), 6U);
  EXPECT_EQ(motion.at("covariance").at(0).at(5), 0.125);
  EXPECT_EQ(motion.at("weak_directions").at(0),
            (nlohmann::json{{"name", "roll"}, {"u95", 2.5}, {"unit", "deg"}}));
  EXPECT_EQ(motion.at("residual_m"), (nlohmann::json{{"median", 0.0015}, {"p95", 0.004}}));
  const auto& correction = json.at("correction");
  EXPECT_EQ(correction.at("isocentre"), (nlohmann::json{0.1, 0.2, 0.3}));
  EXPECT_EQ(correction.at("vertical_mm"), -9.0);
  EXPECT_EQ(correction.at("longitudinal_mm"), 2.0);
  EXPECT_EQ(correction.at("lateral_mm"), 3.0);
  EXPECT_EQ(correction.at("pitch_deg"), 0.1);
  EXPECT_EQ(correction.at("roll_deg"), 0.2);
  EXPECT_EQ(correction.at("yaw_deg"), 0.3);
  EXPECT_EQ(correction.at("uncertainty").at("lateral_mm"), 0.7);
  EXPECT_EQ(json.at("region").at("coverage"), 0.97);
  EXPECT_EQ(json.at("region").at("largest_hole_m"), 0.012);
  EXPECT_EQ(json.at("region").at("min_coverage"), 0.85);
  EXPECT_EQ(json.at("region").at("max_hole_m"), 0.04);
  EXPECT_EQ(json.at("limits"), (nlohmann::json{{"shift_tolerance_mm", 3.0},
                                               {"rotation_tolerance_deg", 1.0},
                                               {"min_shared_markers", 4},
                                               {"moved_marker_mm", 4.0},
                                               {"moved_marker_sigmas", 2.5},
                                               {"min_coverage", 0.85},
                                               {"max_hole_mm", 40.0},
                                               {"max_residual_p95_mm", 25.0},
                                               {"max_lost_s", 0.5},
                                               {"max_breathing_mm", 8.0}}));
  EXPECT_EQ(json.at("deformation").at("samples"), 2);
  EXPECT_EQ(json.at("deformation").at("observed"), 1);
  EXPECT_NEAR(json.at("deformation").at("shift_mm").at("p95").get<double>(), 37.0, 1e-9);
  EXPECT_EQ(json.at("timings_s").at("alignment"), 0.25);
}

TEST(ResultFolderTest, AbsentResultsAreNull) {
  Comparison comparison;
  comparison.reasons = {
      Message::Verbatim("scan needs at least 3 markers shared with the reference, found 1")};
  auto json = nlohmann::json::parse(ResultText(Stored(comparison)));
  EXPECT_EQ(json.at("verdict"), "no_answer");
  for (const char* key : {"alignment", "motion", "correction", "region", "deformation"})
    EXPECT_TRUE(json.at(key).is_null()) << key;

  comparison = Answer();
  comparison.correction->value.vertical_mm.reset();  // refused for couch-fixed markers
  EXPECT_TRUE(nlohmann::json::parse(ResultText(Stored(comparison)))
                  .at("correction")
                  .at("vertical_mm")
                  .is_null());
}

TEST(ResultFolderTest, WritesMapsAndPictures) {
  const TempFolder folder;
  const HeightMap reference = Slope(0.1);
  WriteResult(Answer(), DrawResult(Answer(), &reference), folder / "result");
  EXPECT_THAT(Names(folder / "result"),
              ElementsAre("deformation.ply", "deviation.tiff", "distance.tiff", "error_map.png",
                          "overlay.png", "result.json"));
  const cv::Mat deviation = ReadFloatTiff(folder / "result/deviation.tiff");
  ASSERT_EQ(deviation.size(), cv::Size(120, 80));
  EXPECT_EQ(deviation.at<float>(0, 7), Slope(0.009).z[7]);  // row 0 is y_min
  EXPECT_TRUE(std::isnan(deviation.at<float>(0, 5)));
  EXPECT_FALSE(ReadColorImage(folder / "result/error_map.png").empty());
  EXPECT_EQ(ResultText(ReadResult(folder / "result")), ResultText(Stored(Answer())));
}

TEST(ResultFolderTest, AResultWithARegionReplacesAnOlderOne) {
  const TempFolder folder;
  Comparison answer = Answer();
  answer.region_mask.assign(120 * 80, 1);
  for (int time = 0; time < 2; ++time) WriteResult(answer, {}, folder / "result");
  EXPECT_THAT(Names(folder / "result"), ::testing::Contains("region.png"));
}

TEST(ResultFolderTest, SameResultSameBytes) {
  const TempFolder folder;
  const HeightMap reference = Slope(0.1);
  for (const char* name : {"a", "b"})
    WriteResult(Answer(), DrawResult(Answer(), &reference), folder / name);
  for (const std::string& name : Names(folder / "a")) {
    EXPECT_EQ(ReadWholeFile(folder / "a" / name, 1 << 24),
              ReadWholeFile(folder / "b" / name, 1 << 24))
        << name;
  }
}

TEST(ResultFolderTest, NoAnswerIsWrittenWithoutMaps) {
  const TempFolder folder;
  const HeightMap reference = Slope(0.1);
  WriteResult(Comparison{}, DrawResult(Comparison{}, &reference), folder / "result");
  EXPECT_THAT(Names(folder / "result"), ElementsAre("result.json"));
  WriteResult(Answer(), DrawResult(Answer(), nullptr), folder / "result");  // replaces it
  EXPECT_FALSE(fs::exists(folder / "result/overlay.png"));
}

TEST(ResultFolderTest, AnotherFormatAndDamageAreNamed) {
  const TempFolder folder;
  WriteWholeFile(folder / "result.json", std::string_view("{\"format\": 2}"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadResult(folder.path()); }),
              AllOf(HasSubstr("format 2"), HasSubstr("update")));
  WriteWholeFile(folder / "result.json", std::string_view("{\"format\": 1"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadResult(folder.path()); }),
              HasSubstr("not a result of plumb compare"));
}

}  // namespace
}  // namespace plumb
