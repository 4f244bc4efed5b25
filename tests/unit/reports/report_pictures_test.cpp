// SPDX-License-Identifier: Apache-2.0
// Pictures of reports over a synthetic body. PLUMB_KEEP_PICTURES=FOLDER keeps them to be looked at.
#include "daemon/reports/report_pictures.hpp"

#include <gmock/gmock.h>

#include <cstdlib>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "algo/base/units.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/reports/picture_texts.hpp"
#include "drivers/files/image_file.hpp"
#include "tests/support/result_with.hpp"
#include "tests/support/synthetic_scene.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/support/test_language.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using test::TestLanguage;
using ::testing::SizeIs;

class ReportPicturesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    test::SyntheticOptions on_couch;
    on_couch.couch = true;
    Scene scene = test::MakeSyntheticScene(on_couch);
    WriteScene(scene, reference_ / "scene");
    heights_ = *scene.height_map;
    fs::create_directories(scan_ / "result");
    cv::Mat deviation(heights_.grid.height, heights_.grid.width, CV_32FC1);
    cv::Mat region(deviation.size(), CV_8UC1, cv::Scalar(0));
    for (int row = 0; row < deviation.rows; ++row) {
      for (int column = 0; column < deviation.cols; ++column) {
        const float z = heights_.at(row, column);
        deviation.at<float>(row, column) =
            static_cast<float>(z * 0 + 0.008 * (column - deviation.cols / 2) / deviation.cols);
        if (z > 0.05) region.at<std::uint8_t>(row, column) = 255;
      }
    }
    WriteFloatTiff(scan_ / "result/deviation.tiff", deviation);
    WritePng(scan_ / "result/region.png", region);
  }

  [[nodiscard]] std::vector<cv::Mat> Pictures(const Catalogue& language, double head_y = 1.0,
                                              const char* named_by = "posture") const {
    const nlohmann::json result = {
        {"verdict", "move"},
        {"body",
         {{"named_by", named_by}, {"head_xy", {0.0, head_y}}, {"left_xy", {-head_y, 0.0}}}}};
    return Pictures(result, language);
  }
  [[nodiscard]] std::vector<cv::Mat> Pictures(const nlohmann::json& result,
                                              const Catalogue& language) const {
    const PictureTexts texts(language);
    const StoredResult stored = ParseResult(testing::ResultWith(result.dump()), "result.json");
    return ComparisonPictures(scan_, reference_, stored, 3 * kMillimetre, texts.words(),
                              SideWordsIn(language));
  }

  static void Keep(const cv::Mat& picture, const std::string& name) {
    if (const char* folder = std::getenv("PLUMB_KEEP_PICTURES"))
      WritePng(fs::path(folder) / (name + ".png"), picture);
  }
  static bool Same(const cv::Mat& a, const cv::Mat& b) {
    return a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0.0;
  }

  testing::TempFolder folder_;
  fs::path reference_ = folder_ / "000001", scan_ = folder_ / "000002";
  HeightMap heights_;
};

TEST_F(ReportPicturesTest, NameThePatientsSidesInTheReportsLanguage) {
  const std::vector<cv::Mat> english = Pictures(EnglishCatalogue());
  const std::vector<cv::Mat> other = Pictures(TestLanguage());
  ASSERT_THAT(english, SizeIs(2));
  ASSERT_THAT(other, SizeIs(2));
  const std::vector<cv::Mat> turned = Pictures(EnglishCatalogue(), -1.0);
  const std::vector<cv::Mat> unknown = Pictures(EnglishCatalogue(), 1.0, "axes");
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_FALSE(Same(english[i], other[i]));
    EXPECT_FALSE(Same(english[i], turned[i])) << "head and feet change places";
    EXPECT_FALSE(Same(english[i], unknown[i])) << "without an answer no side is named";
    Keep(english[i], fmt::format("comparison_{}_en", i));
    Keep(other[i], fmt::format("comparison_{}_es", i));
  }
  EXPECT_TRUE(Same(english[0], Pictures(EnglishCatalogue())[0])) << "the same every time";
}

TEST_F(ReportPicturesTest, ShowTheGantryWhereTheResultKnowsTheRoom) {
  const Catalogue& words = EnglishCatalogue();
  nlohmann::json result = {
      {"verdict", "move"},
      {"body", {{"named_by", "posture"}, {"head_xy", {0.0, 1.0}}, {"left_xy", {-1.0, 0.0}}}}};
  const cv::Mat without = Pictures(result, words)[0];
  result["body"]["gantry_xy"] = {0.0, 1.0};
  result["body"]["right_xy"] = {1.0, 0.0};
  const cv::Mat with = Pictures(result, words)[0];
  EXPECT_FALSE(Same(without, with));
  Keep(with, "comparison_gantry");
  result["verdict"] = "no_answer";
  const cv::Mat no_answer = Pictures(result, words)[0];
  EXPECT_FALSE(Same(with, no_answer)) << "without an answer no side is named";
  result["verdict"] = "move";
  result["body"]["named_by"] = "room";
  EXPECT_TRUE(Same(Pictures(result, words)[0], no_answer)) << "the room's axes in both cases";
  result["body"]["named_by"] = "axes";
  result["body"].erase("gantry_xy");
  EXPECT_FALSE(Same(Pictures(result, words)[0], no_answer)) << "no room, no gantry";
}

TEST_F(ReportPicturesTest, AreLeftOutWhereAFileIsMissingOrOfAnotherSize) {
  WritePng(scan_ / "result/region.png", cv::Mat(3, 4, CV_8UC1, cv::Scalar(255)));
  EXPECT_THAT(Pictures(EnglishCatalogue()), SizeIs(0));
  fs::remove(scan_ / "result/region.png");
  EXPECT_THAT(Pictures(EnglishCatalogue()), SizeIs(2)) << "older results have no such file";
  WriteFloatTiff(scan_ / "result/deviation.tiff", cv::Mat(3, 4, CV_32FC1, cv::Scalar(0.0)));
  EXPECT_THAT(Pictures(EnglishCatalogue()), SizeIs(0));
  fs::remove(scan_ / "result/deviation.tiff");
  EXPECT_THAT(Pictures(EnglishCatalogue()), SizeIs(0));
}

TEST_F(ReportPicturesTest, OfAReferenceShowTheRegionAndTheIsocentre) {
  const PictureTexts texts(TestLanguage());
  const PictureWords& words = texts.words();
  const SideWords sides = SideWordsIn(TestLanguage());
  ReferencePlan plan;
  const std::vector<cv::Mat> whole = ReferencePictures(reference_, plan, {}, words, sides).pictures;
  ASSERT_THAT(whole, SizeIs(1));
  plan.region_m = {{-0.2, -0.1}, {0.2, -0.1}, {0.2, 0.15}, {-0.2, 0.15}};
  const std::vector<cv::Mat> region =
      ReferencePictures(reference_, plan, {}, words, sides).pictures;
  ASSERT_THAT(region, SizeIs(1));
  EXPECT_FALSE(Same(whole[0], region[0]));
  plan.isocentre_m = {{0.05, 0.02, 0.1}};
  const std::vector<cv::Mat> isocentre =
      ReferencePictures(reference_, plan, {}, words, sides).pictures;
  ASSERT_THAT(isocentre, SizeIs(1));
  EXPECT_FALSE(Same(region[0], isocentre[0]));
  Keep(isocentre[0], "reference_es");
  MarkerMap asked;
  RoomWays room;
  const RoomFinder room_in = [&](const MarkerMap& scene) {
    asked = scene;
    return room;
  };
  const PlanPictures in_room = ReferencePictures(reference_, plan, room_in, words, sides);
  const std::vector<cv::Mat>& marked = in_room.pictures;
  EXPECT_TRUE(in_room.names_sides);
  EXPECT_FALSE(ReferencePictures(reference_, plan, {}, words, sides).names_sides);
  EXPECT_THAT(asked, SizeIs(8)) << "the room is where the markers of this scene say it is";
  ASSERT_THAT(marked, SizeIs(1));
  EXPECT_FALSE(Same(isocentre[0], marked[0])) << "the gantry and the planned posture";
  Keep(marked[0], "reference_marks_es");
  plan.posture = "FFS";
  EXPECT_FALSE(
      Same(ReferencePictures(reference_, plan, room_in, words, sides).pictures[0], marked[0]))
      << "head and feet change places";
  plan.posture = "HFS";
  room = {.gantry = Eigen::Vector2d::UnitX(), .right = -Eigen::Vector2d::UnitY()};
  EXPECT_FALSE(
      Same(ReferencePictures(reference_, plan, room_in, words, sides).pictures[0], marked[0]))
      << "the marker was turned: so are the marks";
  const PlanPictures none = ReferencePictures(scan_, plan, room_in, words, sides);
  EXPECT_THAT(none.pictures, SizeIs(0)) << "no scene";
  EXPECT_FALSE(none.names_sides);
}

TEST(PictureTexts, AreInEnglishThoseOfAPictureWithoutAReport) {
  const PictureTexts texts(EnglishCatalogue());
  const PictureWords built_in;
  for (const auto text :
       {&PictureWords::notice,         &PictureWords::x_axis,         &PictureWords::y_axis,
        &PictureWords::error_title,    &PictureWords::overlay_title,  &PictureWords::height_title,
        &PictureWords::error,          &PictureWords::absolute_error, &PictureWords::millimetres,
        &PictureWords::centimetres,    &PictureWords::higher,         &PictureWords::lower,
        &PictureWords::tolerance,      &PictureWords::not_in_both,    &PictureWords::not_in_either,
        &PictureWords::not_measured,   &PictureWords::hole,           &PictureWords::outlined,
        &PictureWords::surface_on_top, &PictureWords::reference,      &PictureWords::current,
        &PictureWords::both_within,    &PictureWords::height,         &PictureWords::isocentre})
    EXPECT_EQ(texts.words().*text, built_in.*text);
  EXPECT_EQ(texts.words().decimal, '.');
  EXPECT_EQ(PictureTexts(test::TestLanguage()).words().decimal, ',');
}

}  // namespace
}  // namespace plumb
