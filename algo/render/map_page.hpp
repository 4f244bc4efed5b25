// SPDX-License-Identifier: Apache-2.0
// Draws the page around a map: title, axes, scale bar, legend column and the research notice. Used
// by all pictures.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include "algo/render/figure.hpp"
#include "algo/render/picture_words.hpp"
#include "algo/types/height_map.hpp"

namespace plumb {

struct MapPage {
  std::string title;
  std::string subtitle;  ///< One line under the title, shrunk to fit; may be empty.
  GridShape grid;        ///< Grid of `cells_rgb`.
  cv::Mat cells_rgb;     ///< CV_8UC3, one pixel per cell, row 0 at y_min (the page turns y up).
  std::span<const std::uint8_t>
      outline;  ///< 1 for cells inside an outlined region, on the same grid; may be empty.
  /// Draws the legend in the column to the right of the map.
  std::function<void(Figure&, const cv::Rect&)> draw_legend;
  std::vector<MapMark> marks = {};              ///< At the edges of the map, the first outermost.
  std::optional<Eigen::Vector2d> cross_m = {};  ///< The isocentre in the grid's frame.
  PictureWords words = {};
};

/// Cells to show: all that hold a value in one of the maps plus a margin, or the whole grid if none
/// does. Columns and rows, row 0 at y_min.
[[nodiscard]] cv::Rect CellsWithData(const GridShape& grid,
                                     std::initializer_list<std::span<const float>> maps);

/// The same, cropped to the region and 10 cm around it if there is one, so that the body fills the
/// picture.
/// @param region  1 for cells inside, on the same grid; may be empty.
[[nodiscard]] cv::Rect CellsAroundRegion(const GridShape& grid, const cv::Rect& with_data,
                                         std::span<const std::uint8_t> region);

/// That part of a grid.
[[nodiscard]] GridShape Part(const GridShape& grid, const cv::Rect& cells);

/// That part of a mask of the whole grid; empty if the mask is empty.
[[nodiscard]] std::vector<std::uint8_t> PartOfMask(const GridShape& grid, const cv::Rect& cells,
                                                   std::span<const std::uint8_t> mask);

/// Draws the page: CV_8UC3 RGB, at most about 1600 x 1200 pixels whatever the grid.
[[nodiscard]] cv::Mat DrawPage(const MapPage& page);

/// The number with the decimal sign of the language.
[[nodiscard]] std::string WithDecimalSign(std::string number, const PictureWords& words);

/// A cell's colour, darkened by a factor and paler outside the region.
[[nodiscard]] cv::Vec3b CellColor(const Color& color, double shade, bool is_outside);

/// Draws the bar of a legend, from position 0 at its lower end to 1 at its upper, and one of its
/// ticks. (x, y) is the bar's top left corner, and for a tick its height on the bar.
void DrawColorBar(Figure& figure, double x, double y, double height,
                  const std::function<Color(double position)>& color_at);
void DrawTick(Figure& figure, double x, double y, std::string_view label, bool is_bold = false);

/// Draws a legend line: a swatch and its meaning (wrapped). Returns the y below it.
/// @param picture_rgb  kSwatch_px wide and high.
inline constexpr int kSwatch_px = 24;
double DrawSwatch(Figure& figure, double x, double y, double width, const cv::Mat& picture_rgb,
                  std::string_view meaning);
double DrawSwatch(Figure& figure, double x, double y, double width, const Color& color,
                  std::string_view meaning);

/// Brightness of a surface at a cell, about 0.55..1, lit from the upper left; 1 where a neighbour
/// is missing. Row 0 at y_min; CV_32FC1.
[[nodiscard]] cv::Mat Relief(const HeightMap& heights, const cv::Rect& cells);

}  // namespace plumb
