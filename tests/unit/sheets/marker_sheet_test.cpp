// SPDX-License-Identifier: Apache-2.0
#include "daemon/sheets/marker_sheet.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <stdexcept>

#include "algo/comparison/room_board.hpp"
#include "algo/markers/marker_detector.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::TempFolder;

// What is printed is where the method believes the board's markers, and the cross is in the middle.
TEST(MarkerSheetTest, TheBoardHasItsMarkersWhereTheMethodExpectsThem) {
  constexpr double kDotsPerInch = 150.0, kDotsPerMm = kDotsPerInch / 25.4;
  for (const double length_m : {0.104, 0.06}) {
    SCOPED_TRACE(length_m);
    const MarkerSheet sheet(
        {.dictionary = "DICT_6X6_250", .ids = {}, .length_m = length_m, .is_board = true});
    const RoomBoard board = MakeRoomBoard(250, length_m);
    EXPECT_EQ(sheet.num_pages(), 1);
    EXPECT_EQ(sheet.width_mm(), board.is_a3 ? 297 : 210);
    const cv::Mat picture = sheet.Rasterise(0, kDotsPerInch);
    const MarkerDetection detection =
        MarkerDetector(MarkerDictionary::ByName("DICT_6X6_250")).Detect(picture);
    ASSERT_EQ(detection.markers.size(), board.centres_m.size());
    // On the page y points down.
    const Eigen::Vector2d cross_mm(sheet.width_mm() / 2, 6 + (sheet.height_mm() - 12 - 22) / 2);
    for (const MarkerObservation& marker : detection.markers) {
      Eigen::Vector2d centre = Eigen::Vector2d::Zero();
      for (const Eigen::Vector2d& corner : marker.corners) centre += corner / 4;
      const Eigen::Vector2d known_mm = 1000 * board.centres_m.at(marker.id);
      EXPECT_NEAR((centre.x() + 0.5) / kDotsPerMm, cross_mm.x() + known_mm.x(), 0.2);
      EXPECT_NEAR((centre.y() + 0.5) / kDotsPerMm, cross_mm.y() - known_mm.y(), 0.2);
    }
    const Eigen::Vector2i dot = (cross_mm * kDotsPerMm).cast<int>();
    double darkest = 255;
    for (int x = dot.x() - 2; x <= dot.x() + 2; ++x)
      darkest = std::min<double>(darkest, picture.at<cv::Vec3b>(dot.y() + 20, x)[0]);
    EXPECT_LT(darkest, 128) << "no line for the laser";
    EXPECT_EQ(sheet.Pdf().substr(0, 5), "%PDF-");
  }
}

// The detector of the method reads the sheet as a camera would: every marker, with its id, upright
// and of true size.
TEST(MarkerSheetTest, OurOwnDetectorReadsEverySheetAtTrueSize) {
  constexpr double kDotsPerInch = 150.0;
  const double dots_per_mm = kDotsPerInch / 25.4;
  struct Case {
    SheetOptions options;
    int num_pages;
  };
  const Case cases[] = {{{"DICT_6X6_250", {0, 1, 2, 3, 4}, 0.104, "A4"}, 3},
                        {{"DICT_6X6_250", {95, 7, 249, 12}, 0.104, "A3"}, 1},
                        {{"DICT_ARUCO_MIP_36h12", {0, 100, 249}, 0.05, "A4"}, 1},
                        {{"DICT_4X4_50", {49}, 0.12, "A4"}, 1},
                        {{"DICT_6X6_250", {1, 2}, 0.104, "Letter"}, 2},
                        {{"DICT_6X6_250", {1, 2}, 0.104, "Tabloid"}, 1}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.options.dictionary + " " + c.options.paper);
    const MarkerSheet sheet(c.options);
    EXPECT_EQ(sheet.num_pages(), c.num_pages);
    const MarkerDetector detector(MarkerDictionary::ByName(c.options.dictionary));
    std::set<int> seen;
    for (int page = 0; page < sheet.num_pages(); ++page) {
      const MarkerDetection detection = detector.Detect(sheet.Rasterise(page, kDotsPerInch));
      EXPECT_EQ(detection.markers.size(), sheet.markers(page).size());
      for (const MarkerObservation& marker : detection.markers) {
        seen.insert(marker.id);
        const auto& corners = marker.corners;
        for (int i = 0; i < 4; ++i) {
          const double side_mm = (corners[static_cast<std::size_t>((i + 1) % 4)] -
                                  corners[static_cast<std::size_t>(i)])
                                     .norm() /
                                 dots_per_mm;
          EXPECT_NEAR(side_mm, c.options.length_m * 1000,
                      0.2);  // a dot is 0.17 mm; measured up to 0.09
        }
        EXPECT_LT(corners[0].x(),
                  corners[1].x());  // the first corner is the upper left one on the page
        EXPECT_LT(corners[0].y(), corners[3].y());
      }
    }
    EXPECT_EQ(seen, std::set<int>(c.options.ids.begin(), c.options.ids.end()));
  }
}

TEST(MarkerSheetTest, FilesHaveTheSizeOfThePaper) {
  const TempFolder folder;
  const MarkerSheet sheet({"DICT_6X6_250", {0, 1, 2}, 0.104, "A4"});
  sheet.WritePdf(folder / "sheet.pdf");
  const std::string pdf = ReadTextFile(folder / "sheet.pdf", 10'000'000);
  EXPECT_TRUE(pdf.starts_with("%PDF-"));
  std::smatch box;
  ASSERT_TRUE(std::regex_search(pdf, box, std::regex(R"(MediaBox \[ ?0 0 ([0-9.]+) ([0-9.]+))")));
  EXPECT_NEAR(std::stod(box[1]), 210 * 72 / 25.4, 0.01);
  EXPECT_NEAR(std::stod(box[2]), 297 * 72 / 25.4, 0.01);
  EXPECT_TRUE(pdf.find("/Count 2") != std::string::npos) << "expected two pages";
  sheet.WriteSvg(folder / "sheet.svg", 0);
  const std::string svg = ReadTextFile(folder / "sheet.svg", 10'000'000);
  EXPECT_THAT(svg, HasSubstr("width=\"210mm\" height=\"297mm\""));
}

TEST(MarkerSheetTest, SaysWhatDoesNotFit) {
  const auto message = [](const SheetOptions& options) {
    return MessageOf<std::invalid_argument>([&] { const MarkerSheet sheet(options); });
  };
  EXPECT_THAT(message({"DICT_6X6_250", {0}, 0.3, "A4"}), HasSubstr("expected 0.01 to 0.1"));
  EXPECT_THAT(message({"DICT_6X6_250", {250}, 0.1, "A4"}), HasSubstr("ids are 0 to 249"));
  EXPECT_THAT(message({"DICT_NONE", {0}, 0.1, "A4"}), HasSubstr("DICT_NONE"));
  EXPECT_THAT(message({"DICT_6X6_250", {}, 0.1, "A4"}), HasSubstr("found 0"));
  EXPECT_THAT(message({"DICT_6X6_250", {0}, 0.1, "A5"}),
              HasSubstr("expected A4, A3, Letter or Tabloid"));
}

TEST(MarkerSheetTest, ReadsIds) {
  EXPECT_THAT(ParseIds("0-3,20"), ElementsAre(0, 1, 2, 3, 20));
  EXPECT_THAT(ParseIds("7"), ElementsAre(7));
  for (const char* bad :
       {"", "a", "1-", "3-1", "1,,2", "-1", "0-99999999", "1 2", "99999999999999"})
    EXPECT_THROW((void)ParseIds(bad), std::invalid_argument) << bad;
}

}  // namespace
}  // namespace plumb
