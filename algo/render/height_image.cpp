// SPDX-License-Identifier: Apache-2.0
#include "algo/render/height_image.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "algo/render/map_page.hpp"

namespace plumb {
namespace {

// Lightness increases with height, readable in grey and with any colour vision.
constexpr Color kLow = {34, 74, 120}, kHigh = {240, 226, 168};
constexpr double kHeightReliefStrength = 0.6;  // strength of the shading

struct Range {
  double low_m = 0.0, high_m = 1e-3;
};

/// Range of heights in the region, if there is one, because the floor beside it would use most of
/// the colours. The few outliers at either end are excluded.
Range RangeOf(const HeightMap& heights, std::span<const std::uint8_t> region) {
  std::vector<float> known;
  for (std::size_t cell = 0; cell < heights.z.size(); ++cell) {
    if (std::isfinite(heights.z[cell]) && (region.empty() || region[cell] != 0))
      known.push_back(heights.z[cell]);
  }
  if (known.empty()) return {};
  const double low = TakeQuantile(known, 0.005), high = TakeQuantile(known, 0.995);
  return {low, std::max(high, low + 1e-3)};
}

cv::Mat ColoredCells(const HeightMap& heights, std::span<const std::uint8_t> region,
                     const Range& range, const cv::Rect& cells) {
  const cv::Mat relief = Relief(heights, cells);
  cv::Mat picture(cells.height, cells.width, CV_8UC3);
  for (int row = 0; row < cells.height; ++row) {
    auto* out = picture.ptr<cv::Vec3b>(row);
    for (int column = 0; column < cells.width; ++column) {
      const float z = heights.at(cells.y + row, cells.x + column);
      if (!std::isfinite(z)) {
        out[column] = cv::Vec3b(kHoleColor[0], kHoleColor[1], kHoleColor[2]);
        continue;
      }
      const Color color =
          Mix(kLow, kHigh, std::clamp((z - range.low_m) / (range.high_m - range.low_m), 0.0, 1.0));
      const double shade =
          1.0 - kHeightReliefStrength * (1.0 - std::min(1.0F, relief.at<float>(row, column)));
      const std::size_t cell = heights.grid.index(cells.y + row, cells.x + column);
      out[column] = CellColor(color, shade, !region.empty() && region[cell] == 0);
    }
  }
  return picture;
}

void DrawLegend(Figure& figure, const cv::Rect& area, const Range& range,
                const HeightImageOptions& options) {
  const PictureWords& words = options.words;
  const double x = area.x;
  figure.Text(x, area.y + 14, words.height, {.size_px = 18, .color = kInk, .bold = true});
  figure.Text(x, area.y + 38, words.centimetres, {.size_px = 16, .color = kFaint});
  const double top = area.y + 60, height = std::max(180.0, area.height - 60.0 - 170.0);
  DrawColorBar(figure, x, top, height, [](double position) { return Mix(kLow, kHigh, position); });
  constexpr int kTicks = 5;
  for (int i = 0; i < kTicks; ++i) {
    const double position = static_cast<double>(i) / (kTicks - 1);
    const double height_m = range.low_m + position * (range.high_m - range.low_m);
    DrawTick(figure, x, top + (1.0 - position) * height,
             WithDecimalSign(fmt::format("{:.1f}", height_m / kCentimetre), words));
  }
  double y = DrawSwatch(figure, x, top + height + 18, area.width, kHoleColor, words.not_measured);
  if (!options.region_mask.empty())
    DrawSwatch(figure, x, y, area.width, Color{255, 255, 255}, words.outlined);
}

}  // namespace

cv::Mat DrawHeightImage(const HeightMap& heights, const HeightImageOptions& options) {
  if (!options.region_mask.empty() && options.region_mask.size() != heights.grid.num_cells())
    throw std::invalid_argument("the region of a height image lies on another grid");
  const Range range = RangeOf(heights, options.region_mask);
  const cv::Rect cells = CellsAroundRegion(heights.grid, CellsWithData(heights.grid, {heights.z}),
                                           options.region_mask);
  const std::vector<std::uint8_t> outline = PartOfMask(heights.grid, cells, options.region_mask);
  return DrawPage(
      {.title = std::string(options.words.height_title),
       .subtitle = std::string(options.subtitle),
       .grid = Part(heights.grid, cells),
       .cells_rgb = ColoredCells(heights, options.region_mask, range, cells),
       .outline = outline,
       .draw_legend = [&](Figure& figure,
                          const cv::Rect& area) { DrawLegend(figure, area, range, options); },
       .marks = options.marks,
       .cross_m = options.isocentre_m,
       .words = options.words});
}

}  // namespace plumb
