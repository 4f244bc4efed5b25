// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>

#include <gtest/gtest.h>

#include "algo/render/error_image.hpp"
#include "algo/render/overlay_image.hpp"

namespace plumb {
namespace {

/// A grid of 1 m x 0.6 m, everything at one height but the columns and rows that `heights` changes.
HeightMap Flat(double z) {
  HeightMap map({.x_min = -0.1, .y_min = -0.2, .step = 0.005, .width = 200, .height = 120});
  std::fill(map.z.begin(), map.z.end(), static_cast<float>(z));
  return map;
}

void SetRows(HeightMap& map, int first, int last, float z) {
  std::fill(map.z.begin() + static_cast<std::ptrdiff_t>(first) * map.grid.width,
            map.z.begin() + static_cast<std::ptrdiff_t>(last) * map.grid.width, z);
}

/// Share of a picture's pixels within a few grey levels of a colour.
double Share(const cv::Mat& picture, const Color& color, int tolerance = 3) {
  int count = 0;
  for (int row = 0; row < picture.rows; ++row) {
    for (int column = 0; column < picture.cols; ++column) {
      const auto& p = picture.at<cv::Vec3b>(row, column);
      bool is_near = true;
      for (int i = 0; i < 3; ++i)
        is_near = is_near && std::abs(p[i] - color[static_cast<std::size_t>(i)]) <= tolerance;
      count += is_near ? 1 : 0;
    }
  }
  return static_cast<double>(count) / static_cast<double>(picture.total());
}

/// Mean row of the pixels of a colour, as a share of the height; -1 for none.
double MeanRow(const cv::Mat& picture, const Color& color, int last_column) {
  double sum = 0;
  int count = 0;
  for (int row = 0; row < picture.rows; ++row) {
    for (int column = 0; column < last_column; ++column) {
      if (picture.at<cv::Vec3b>(row, column) == cv::Vec3b(color[0], color[1], color[2]))
        sum += row, ++count;
    }
  }
  return count == 0 ? -1 : sum / count / picture.rows;
}

TEST(ErrorImageTest, MarksInOneDirectionDoNotCoverEachOther) {
  constexpr Color kMarkInk = {20, 60, 90};
  const auto ink = [&](const Eigen::Vector2d& toward, std::size_t num_marks) {
    ErrorImageOptions options;
    options.marks.assign(num_marks, {"GANTRY", toward});
    return Share(DrawErrorImage(Flat(0), options), kMarkInk);
  };
  for (const Eigen::Vector2d& toward :
       {Eigen::Vector2d(0, 1), Eigen::Vector2d(-1, 0), Eigen::Vector2d(0.6, -0.8)}) {
    const double one = ink(toward, 1);
    ASSERT_GT(one, 0);
    EXPECT_GT(ink(toward, 2), 1.8 * one) << toward.transpose();
  }
}

TEST(ErrorImageTest, DrawsYUp) {
  HeightMap difference = Flat(0);
  SetRows(difference, 90, 120, 0.012F);  // large y: the upper quarter of the map
  const cv::Mat picture = DrawErrorImage(difference);
  ASSERT_EQ(picture.type(), CV_8UC3);
  const double row = MeanRow(picture, ColorScale::Signed(0.003)(0.012), picture.cols * 3 / 4);
  EXPECT_GT(row, 0.05);
  EXPECT_LT(row, 0.35);
}

TEST(ErrorImageTest, HolesAreGreyAndNeverTheColourOfZero) {
  HeightMap difference = Flat(0);
  SetRows(difference, 30, 60, std::numeric_limits<float>::quiet_NaN());
  const double with_hole = Share(DrawErrorImage(difference), kHoleColor),
               without = Share(DrawErrorImage(Flat(0)), kHoleColor);
  EXPECT_GT(with_hole - without, 0.1);  // a quarter of a map that takes half of the page
}

TEST(ErrorImageTest, AHoleInTheRegionIsToldFromWhatWasNotMeasuredElsewhere) {
  HeightMap difference = Flat(0);
  SetRows(difference, 30, 60, std::numeric_limits<float>::quiet_NaN());
  std::vector<std::uint8_t> region(difference.grid.num_cells(), 1);
  const cv::Mat inside = DrawErrorImage(difference, {.region_mask = region});
  EXPECT_GT(Share(inside, kRegionHoleColor), 0.04) << "every second stripe";
  constexpr int kLegendFrom = 240;  // pixels from the right
  const cv::Mat legend = inside.colRange(inside.cols - kLegendFrom, inside.cols);
  const double swatch = Share(legend, kRegionHoleColor) * static_cast<double>(legend.total());
  EXPECT_GT(swatch, 100) << "hatched in the legend, too";
  EXPECT_LT(swatch, 350) << "a plain one has 484 within its frame";
  std::fill(region.begin(), region.begin() + std::ptrdiff_t{70} * difference.grid.width,
            std::uint8_t{0});
  const cv::Mat outside = DrawErrorImage(difference, {.region_mask = region});
  EXPECT_LT(Share(outside, kRegionHoleColor), 0.001) << "no legend for it either";
  SetRows(difference, 30, 60, 0);
  std::fill(region.begin(), region.end(), std::uint8_t{1});
  difference.z[45 * 200 + 80] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_LT(Share(DrawErrorImage(difference, {.region_mask = region}), kRegionHoleColor), 0.001)
      << "a single cell is no hole";
}

TEST(ErrorImageTest, CarriesTheNoticeInThePicture) {
  // The strip of the notice has its own colours at the foot of the page, for every map.
  const cv::Mat picture = DrawErrorImage(Flat(0));
  const cv::Mat foot = picture.rowRange(picture.rows - 30, picture.rows);
  EXPECT_GT(Share(foot, {253, 240, 222}), 0.5);
  EXPECT_GT(Share(foot, {122, 28, 10}, 40), 0.03);
}

TEST(ErrorImageTest, PaperColoursShowZeroAsBlue) {
  EXPECT_GT(Share(DrawErrorImage(Flat(0), {.paper_colors = true}), {0, 0, 255}), 0.3);
  EXPECT_GT(Share(DrawErrorImage(Flat(-0.3), {.paper_colors = true}), {255, 0, 0}), 0.3);
}

TEST(ErrorImageTest, ShowsThePartThatHoldsData) {
  HeightMap difference({.x_min = 0, .y_min = 0, .step = 0.002, .width = 1500, .height = 1500});
  for (int row = 700; row < 900; ++row) {
    for (int column = 100; column < 300; ++column)
      difference.z[static_cast<std::size_t>(row) * 1500 + static_cast<std::size_t>(column)] = 0.02F;
  }
  EXPECT_GT(Share(DrawErrorImage(difference), ColorScale::Signed(0.003)(0.02)), 0.25);
}

TEST(ErrorImageTest, ShowsTheRegionAndTenCentimetresAroundIt) {
  // 2 m x 2 m, of which a square of 20 cm is the region: with its surroundings 40 cm are shown.
  HeightMap difference({.x_min = 0, .y_min = 0, .step = 0.01, .width = 200, .height = 200});
  std::fill(difference.z.begin(), difference.z.end(), 0.0F);
  std::vector<std::uint8_t> region(difference.grid.num_cells(), 0);
  for (std::size_t row = 90; row < 110; ++row) {
    for (std::size_t column = 30; column < 50; ++column) {
      region[row * 200 + column] = 1;
      difference.z[row * 200 + column] = 0.02F;
    }
  }
  const Color high = ColorScale::Signed(0.003)(0.02);
  // A quarter of a map that takes half of the page; without the region it is a hundredth.
  EXPECT_GT(Share(DrawErrorImage(difference, {.region_mask = region}), high), 0.08);
  EXPECT_LT(Share(DrawErrorImage(difference), high), 0.02);
  const std::vector<std::uint8_t> nowhere(region.size(), 0);
  EXPECT_LT(Share(DrawErrorImage(difference, {.region_mask = nowhere}), high), 0.02);
}

TEST(ErrorImageTest, DrawsAnEmptyMapAndATinyOne) {
  EXPECT_FALSE(DrawErrorImage(
                   HeightMap({.x_min = 0, .y_min = 0, .step = 0.0015, .width = 400, .height = 300}))
                   .empty());
  HeightMap cell({.x_min = 0, .y_min = 0, .step = 0.0015, .width = 1, .height = 1});
  cell.z[0] = 0.001F;
  EXPECT_FALSE(DrawErrorImage(cell).empty());
}

TEST(ErrorImageTest, StaysSmallForAnyGrid) {
  for (const auto& [width, height] :
       {std::pair(2666, 2666), std::pair(2666, 20), std::pair(20, 2666)}) {
    HeightMap difference(
        {.x_min = 0, .y_min = 0, .step = 0.0015, .width = width, .height = height});
    std::fill(difference.z.begin(), difference.z.end(), 0.0F);
    const cv::Mat picture = DrawErrorImage(difference);
    EXPECT_LE(picture.cols, 1700);
    EXPECT_LE(picture.rows, 1300);
  }
}

TEST(ErrorImageTest, RefusesOtherGridsAndEmptyOnes) {
  EXPECT_THROW((void)DrawErrorImage(
                   HeightMap({.x_min = 0, .y_min = 0, .step = 0.0015, .width = 0, .height = 0})),
               std::invalid_argument);
  const HeightMap other({.x_min = 0, .y_min = 0, .step = 0.01, .width = 3, .height = 3});
  EXPECT_THROW((void)DrawErrorImage(Flat(0), {.relief = &other}), std::invalid_argument);
  const std::vector<std::uint8_t> mask(7, 1);
  EXPECT_THROW((void)DrawErrorImage(Flat(0), {.region_mask = mask}), std::invalid_argument);
}

TEST(OverlayImageTest, ReferenceIsBlueCurrentIsRedAndTheHigherOneIsOnTop) {
  HeightMap reference = Flat(0.05), current = Flat(0.05);
  SetRows(reference, 0, 30, 0.15F);
  SetRows(current, 90, 120, 0.15F);
  const cv::Mat picture = DrawOverlayImage(reference, current);
  const int end = picture.cols * 3 / 4;
  // A level surface is lit by exactly 1. Rows count downwards, y upwards.
  EXPECT_GT(MeanRow(picture, {40, 104, 214}, end), 0.6);
  const double red = MeanRow(picture, {226, 62, 46}, end);
  EXPECT_GT(red, 0.05);
  EXPECT_LT(red, 0.4);
}

TEST(OverlayImageTest, ASurfaceThatOnlyOneScanSawKeepsItsColour) {
  HeightMap reference = Flat(0.05), current = Flat(0.05);
  SetRows(reference, 0, 120, std::numeric_limits<float>::quiet_NaN());
  EXPECT_GT(Share(DrawOverlayImage(reference, current), {226, 62, 46}), 0.3);
  EXPECT_GT(Share(DrawOverlayImage(current, reference), {40, 104, 214}), 0.3);
}

TEST(OverlayImageTest, ShowsTheRegionAndTenCentimetresAroundIt) {
  HeightMap reference({.x_min = 0, .y_min = 0, .step = 0.01, .width = 200, .height = 200});
  std::fill(reference.z.begin(), reference.z.end(), 0.0F);
  HeightMap current = reference;
  std::vector<std::uint8_t> region(reference.grid.num_cells(), 0);
  for (std::size_t row = 90; row < 110; ++row) {
    for (std::size_t column = 30; column < 50; ++column) {
      region[row * 200 + column] = 1;
      current.z[row * 200 + column] = 0.02F;
    }
  }
  const Color red = {226, 62, 46};
  EXPECT_GT(Share(DrawOverlayImage(reference, current, {.region_mask = region}), red, 60), 0.05);
  EXPECT_LT(Share(DrawOverlayImage(reference, current), red, 60), 0.02);
  const std::vector<std::uint8_t> other(7, 1);
  EXPECT_THROW((void)DrawOverlayImage(reference, current, {.region_mask = other}),
               std::invalid_argument);
}

TEST(OverlayImageTest, RefusesTwoGrids) {
  const HeightMap other({.x_min = 0, .y_min = 0, .step = 0.01, .width = 3, .height = 3});
  EXPECT_THROW((void)DrawOverlayImage(Flat(0), other), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
