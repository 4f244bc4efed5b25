// SPDX-License-Identifier: Apache-2.0
#include "algo/render/error_image.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "algo/render/map_page.hpp"

namespace plumb {
namespace {

constexpr Color kRegionHoleLight = {255, 255, 255};

/// Weak shading keeps the legend readable: at most 14 % darker.
constexpr double kErrorReliefStrength = 0.30;

cv::Vec3b PixelOf(const Color& color) { return {color[0], color[1], color[2]}; }

/// Stripes of a hole, which any eyes tell from the scale.
cv::Vec3b HatchAt(int row, int column) {
  return PixelOf((row + column) % 12 < 6 ? kRegionHoleColor : kRegionHoleLight);
}

cv::Mat HatchedSwatch() {
  cv::Mat swatch(kSwatch_px, kSwatch_px, CV_8UC3);
  for (int row = 0; row < kSwatch_px; ++row)
    for (int column = 0; column < kSwatch_px; ++column)
      swatch.at<cv::Vec3b>(row, column) = HatchAt(kSwatch_px - 1 - row, column);  // y up
  return swatch;
}

/// True for an unmeasured cell of the region that has an unmeasured neighbour there: single cells
/// are sampling noise of the grid.
bool IsHole(const HeightMap& difference, std::span<const std::uint8_t> region, int row,
            int column) {
  const auto is_missing = [&](int r, int c) {
    if (!difference.grid.contains(r, c)) return false;
    const std::size_t cell = difference.grid.index(r, c);
    return region[cell] != 0 && !std::isfinite(difference.z[cell]);
  };
  return is_missing(row, column) && (is_missing(row - 1, column) || is_missing(row + 1, column) ||
                                     is_missing(row, column - 1) || is_missing(row, column + 1));
}

bool HasHole(const HeightMap& difference, std::span<const std::uint8_t> region) {
  if (region.empty()) return false;
  for (int row = 0; row < difference.grid.height; ++row)
    for (int column = 0; column < difference.grid.width; ++column)
      if (IsHole(difference, region, row, column)) return true;
  return false;
}

cv::Mat ColoredCells(const HeightMap& difference, const ErrorImageOptions& options,
                     const ColorScale& scale, const cv::Rect& cells) {
  // A table over the legend: one logarithm per cell is cheap, and no search among colours is
  // needed.
  constexpr int kTableSize = 4096;
  std::vector<Color> table(kTableSize + 1);
  for (int i = 0; i <= kTableSize; ++i)
    table[static_cast<std::size_t>(i)] =
        scale(scale.Difference(static_cast<double>(i) / kTableSize));
  const cv::Mat relief = options.relief != nullptr ? Relief(*options.relief, cells) : cv::Mat();
  cv::Mat picture(cells.height, cells.width, CV_8UC3);
  for (int row = 0; row < cells.height; ++row) {
    auto* out = picture.ptr<cv::Vec3b>(row);
    for (int column = 0; column < cells.width; ++column) {
      const float e = difference.at(cells.y + row, cells.x + column);
      if (!std::isfinite(e)) {
        const bool is_hole =
            !options.region_mask.empty() &&
            IsHole(difference, options.region_mask, cells.y + row, cells.x + column);
        out[column] = is_hole ? HatchAt(row, column) : PixelOf(kHoleColor);
        continue;
      }
      const Color& color =
          table[static_cast<std::size_t>(std::lround(scale.Position(e) * kTableSize))];
      double shade =
          relief.empty()
              ? 1.0
              : 1.0 - kErrorReliefStrength * (1.0 - std::min(1.0F, relief.at<float>(row, column)));
      const std::size_t cell = difference.grid.index(cells.y + row, cells.x + column);
      out[column] =
          CellColor(color, shade, !options.region_mask.empty() && options.region_mask[cell] == 0);
    }
  }
  return picture;
}

std::string LabelOf(const ColorScale::Tick& tick, bool is_tolerance, const PictureWords& words) {
  const std::string label = WithDecimalSign(tick.label, words);
  return is_tolerance ? fmt::format("{}  {}", label, words.tolerance) : label;
}

void DrawLegend(Figure& figure, const cv::Rect& area, const ColorScale& scale, bool has_region,
                bool has_hole, const PictureWords& words) {
  const double x = area.x;
  double y = area.y;
  const TextStyle head{.size_px = 18, .color = kInk, .bold = true};
  figure.Text(x, y + 14, scale.is_signed() ? words.error : words.absolute_error, head);
  figure.Text(x, y + 38, scale.is_signed() ? words.millimetres : words.centimetres,
              {.size_px = 16, .color = kFaint});
  y += scale.is_signed() ? 84 : 60;
  const TextStyle small{.size_px = 15, .color = kFaint};
  if (scale.is_signed()) figure.Text(x, y - 15, words.higher, small);
  const double below =
      (scale.is_signed() ? 24 : 0) + 150 + (has_region ? 46 : 0) + (has_hole ? 46 : 0);
  const double height = std::max(180.0, area.y + area.height - y - below);
  DrawColorBar(figure, x, y, height,
               [&](double position) { return scale(scale.Difference(position)); });
  double last_y = -1e9;
  for (const ColorScale::Tick& tick : scale.Ticks()) {
    const double at = y + (1.0 - scale.Position(tick.difference_m)) * height;
    if (std::abs(at - last_y) < 15) continue;
    last_y = at;
    const bool is_tolerance =
        scale.is_signed() && std::abs(std::abs(tick.difference_m) - scale.tolerance_m()) < 1e-12;
    DrawTick(figure, x, at, LabelOf(tick, is_tolerance, words), is_tolerance);
  }
  y += height;
  if (scale.is_signed()) figure.Text(x, y + 22, words.lower, small), y += 24;
  y = DrawSwatch(figure, x, y + 18, area.width, kHoleColor, words.not_in_both);
  if (has_hole) y = DrawSwatch(figure, x, y, area.width, HatchedSwatch(), words.hole);
  if (has_region) DrawSwatch(figure, x, y, area.width, Color{255, 255, 255}, words.outlined);
}

}  // namespace

cv::Mat DrawErrorImage(const HeightMap& difference, const ErrorImageOptions& options) {
  const bool bad_relief = options.relief != nullptr && !(options.relief->grid == difference.grid);
  const bool bad_region =
      !options.region_mask.empty() && options.region_mask.size() != difference.grid.num_cells();
  if (bad_relief || bad_region)
    throw std::invalid_argument(fmt::format("the {} of an error image lies on another grid",
                                            bad_relief ? "relief" : "region"));
  const ColorScale scale =
      options.paper_colors ? ColorScale::Paper() : ColorScale::Signed(options.tolerance_m);
  const cv::Rect cells = CellsAroundRegion(
      difference.grid, CellsWithData(difference.grid, {difference.z}), options.region_mask);
  const std::vector<std::uint8_t> outline = PartOfMask(difference.grid, cells, options.region_mask);
  const bool has_hole = HasHole(difference, options.region_mask);
  return DrawPage({.title = std::string(options.words.error_title),
                   .subtitle = options.subtitle,
                   .grid = Part(difference.grid, cells),
                   .cells_rgb = ColoredCells(difference, options, scale, cells),
                   .outline = outline,
                   .draw_legend =
                       [&](Figure& figure, const cv::Rect& area) {
                         DrawLegend(figure, area, scale, !outline.empty(), has_hole, options.words);
                       },
                   .marks = options.marks,
                   .words = options.words});
}

}  // namespace plumb
