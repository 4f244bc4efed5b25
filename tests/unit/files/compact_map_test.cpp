// SPDX-License-Identifier: Apache-2.0
// Packed maps read back as the maps they were made of, and reports are whole PDF files.
#include "daemon/files/compact_map.hpp"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "daemon/reports/pdf_report.hpp"
#include "drivers/files/image_file.hpp"
#include "tests/support/temp_folder.hpp"
#include "words/direction.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// As a browser reads it, written from the description in the header.
cv::Mat Unpacked(const std::string& bytes) {
  const auto number = [&](std::size_t i) {
    return static_cast<unsigned char>(bytes[4 + 2 * i]) |
           static_cast<unsigned char>(bytes[5 + 2 * i]) << 8;
  };
  EXPECT_EQ(bytes.substr(0, 4), "PLM1");
  const int x0 = number(2), y0 = number(3), w = number(4), h = number(5);
  std::vector<unsigned char> cells(2 * static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
  uLongf size = cells.size();
  EXPECT_EQ(uncompress(cells.data(), &size, reinterpret_cast<const Bytef*>(bytes.data() + 16),
                       bytes.size() - 16),
            Z_OK);
  EXPECT_EQ(size, cells.size());
  cv::Mat map(number(1), number(0), CV_16SC1, cv::Scalar(-32768));
  for (int row = 0; row < h; ++row) {
    std::uint16_t cell = 0;
    for (int column = 0; column < w; ++column) {
      const std::size_t at = 2 * (static_cast<std::size_t>(row) * static_cast<std::size_t>(w) +
                                  static_cast<std::size_t>(column));
      cell = static_cast<std::uint16_t>(cell + (cells[at] | cells[at + 1] << 8));
      map.at<std::int16_t>(y0 + row, x0 + column) = static_cast<std::int16_t>(cell);
    }
  }
  return map;
}

TEST(CompactMap, KeepsTenthsOfAMillimetreAndWhatIsEmpty) {
  const testing::TempFolder folder;
  fs::create_directories(folder / "scene");
  cv::Mat heights(50, 70, CV_32FC1, cv::Scalar(kNaN));
  for (int row = 10; row < 40; ++row) {
    for (int column = 20; column < 60; ++column)
      heights.at<float>(row, column) = 0.001F * static_cast<float>(row - 2 * column);
  }
  heights.at<float>(20, 30) = kNaN;
  heights.at<float>(21, 30) = 9.0F;  // beyond what 16 bits hold
  WriteFloatTiff(folder / "scene/heightmap.tiff", heights);
  const std::string packed = CompactMap(folder / "", "heightmap");
  EXPECT_LT(packed.size(), 1500U);
  const cv::Mat map = Unpacked(packed);
  ASSERT_EQ(map.size(), heights.size());
  for (int row = 0; row < map.rows; ++row) {
    for (int column = 0; column < map.cols; ++column) {
      const float metres = heights.at<float>(row, column);
      const int expected = std::isnan(metres)
                               ? -32768
                               : std::min(32767, static_cast<int>(std::lround(metres * 10000)));
      ASSERT_EQ(map.at<std::int16_t>(row, column), expected) << row << ", " << column;
    }
  }
}

TEST(CompactMap, OfHeightsInMemoryTellsWhatIsMissingFromEveryHeight) {
  HeightMap heights({.x_min = -0.1, .y_min = 0, .step = 0.02, .width = 5, .height = 4});
  heights.z[7] = 0.1234F;
  heights.z[8] = 9.0F;  // clamped below the mark of what is missing
  std::vector<std::uint8_t> missing(heights.z.size(), 0);
  missing[13] = 1;
  const cv::Mat map = Unpacked(CompactHeights(heights, missing));
  ASSERT_EQ(map.size(), cv::Size(5, 4));
  EXPECT_EQ(map.at<std::int16_t>(1, 2), 1234);
  EXPECT_EQ(map.at<std::int16_t>(1, 3), 32766);
  EXPECT_EQ(map.at<std::int16_t>(2, 3), 32767);
  EXPECT_EQ(map.at<std::int16_t>(0, 0), -32768);
  EXPECT_EQ(Unpacked(CompactHeights(heights, {})).at<std::int16_t>(1, 2), 1234);
}

TEST(CompactMap, TellsAHoleOfTheRegionFromWhatLiesOutside) {
  const testing::TempFolder folder;
  fs::create_directories(folder / "result");
  cv::Mat deviation(6, 6, CV_32FC1, cv::Scalar(0.002)), region(6, 6, CV_8UC1, cv::Scalar(0));
  region(cv::Rect(1, 1, 4, 4)) = 255;
  deviation.at<float>(2, 2) = kNaN;
  deviation.at<float>(0, 0) = kNaN;
  WriteFloatTiff(folder / "result/deviation.tiff", deviation);
  WritePng(folder / "result/region.png", region);
  const cv::Mat map = Unpacked(CompactMap(folder / "", "region"));
  EXPECT_EQ(map.at<std::int16_t>(1, 1), 1);
  EXPECT_EQ(map.at<std::int16_t>(2, 2), 2);
  EXPECT_EQ(map.at<std::int16_t>(0, 0), -32768);
  EXPECT_THROW((void)CompactMap(folder / "", "deviation_after"), DataError);
  EXPECT_THROW((void)CompactMap(folder / "", "../../etc/passwd"), DataError);
}

TEST(PdfReport, IsAWholeFileWhateverIsMissing) {
  ScanReport report{
      .title = "Scan report",
      .verdict = "MOVE",
      .why = "The correction below was to be applied.",
      .identity = {{"Patient", "P-0042"}, {"Approved by", "clara"}},
      .numbers = {OnCouch({.name = NumberWord(0),
                           .number = 0,
                           .value = -8.04,
                           .u95 = 0.6,
                           .tolerance = 3.0,
                           .judgement = NumberJudgement::kOutside,
                           .words = say::direction::Down()},
                          Verdict::kMove, {}),
                  OnCouch({.name = NumberWord(3),
                           .number = 3,
                           .value = 0.01,
                           .u95 = 0.14,
                           .tolerance = 1.0,
                           .judgement = NumberJudgement::kWithin,
                           .words = {}},
                          Verdict::kMove, {}),
                  OnCouch({.name = NumberWord(2),
                           .number = 2,
                           .value = std::nullopt,
                           .u95 = std::nullopt,
                           .tolerance = 3.0,
                           .judgement = NumberJudgement::kUnjudged,
                           .words = {}},
                          Verdict::kMove, {})},
      .cautions = {"The daily check was overdue at this scan."},
      .quality = {{"Markers matched", "8"}},
      .body = {},
      .pictures = {cv::Mat(30, 40, CV_8UC3, cv::Scalar(200, 0, 0)), cv::Mat(1, 1, CV_8UC3)},
      .footer = "Plumb"};
  const std::string pdf = PdfOf(report);
  EXPECT_EQ(pdf.substr(0, 5), "%PDF-");
  EXPECT_NE(pdf.find("%%EOF"), std::string::npos);
  CourseReport course{.title = "Course", .identity = {}, .rows = {}, .note = "", .footer = ""};
  const std::size_t empty = PdfOf(course).size();
  for (int i = 0; i < 120; ++i)
    course.rows.push_back({.fraction = std::to_string(i),
                           .when = "2026-01-01 10:00",
                           .verdict = "IN TOLERANCE",
                           .accepted = "anna",
                           .values = {CourseValue{0.1, 0.9}, CourseValue{-3.2, 1.1}}});
  const std::string long_course = PdfOf(course);
  EXPECT_GT(long_course.size(), empty);
  const std::size_t count = long_course.find("/Count ");
  ASSERT_NE(count, std::string::npos);
  EXPECT_GT(std::stoi(long_course.substr(count + 7)), 1) << "pages; how many, the fonts decide";
  EXPECT_NE(long_course.find("/MediaBox [ 0 0 841"), std::string::npos)
      << "across, for its columns";
  EXPECT_NE(pdf.find("/MediaBox [ 0 0 595"), std::string::npos);
}

TEST(PdfReportTest, PicturesHaveAPageOfTheirOwnAndTheFileIsSmall) {
  ScanReport report;
  report.title = "Scan";
  EXPECT_NE(PdfOf(report).find("/Count 1"), std::string::npos);
  cv::Mat picture(900, 1400, CV_8UC3);
  for (int row = 0; row < picture.rows; ++row)
    for (int column = 0; column < picture.cols; ++column)
      picture.at<cv::Vec3b>(row, column) = {
          static_cast<std::uint8_t>(row / 4), static_cast<std::uint8_t>(column / 6),
          static_cast<std::uint8_t>((row * 31 + column * 17) % 9)};
  report.pictures = {picture, picture};
  const std::string pdf = PdfOf(report);
  EXPECT_NE(pdf.find("/Count 2"), std::string::npos);
  EXPECT_NE(pdf.find("/DCTDecode"), std::string::npos);
  EXPECT_LT(pdf.size(), 1'000'000U) << "2 x 3.8 MB of pixels";
}

TEST(PdfReportTest, ATrendIsDrawnFromTwoScansOn) {
  ScanReport report;
  report.title = "Scan";
  const CourseRow row{.fraction = "1",
                      .when = "",
                      .verdict = "",
                      .accepted = "",
                      .values = {CourseValue{0.1, 0.9}, std::nullopt, CourseValue{-3.2, {}}}};
  const std::size_t without = PdfOf(report).size();
  report.trend = {row};
  EXPECT_EQ(PdfOf(report).size(), without);
  report.trend = {row, row};
  EXPECT_GT(PdfOf(report).size(), without);
}

}  // namespace
}  // namespace plumb
