// SPDX-License-Identifier: Apache-2.0
#include "algo/render/overlay_image.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/render/map_page.hpp"

namespace plumb {
namespace {

// Lightness differs as well as hue, and violet is between them: readable with any colour vision.
constexpr Color kReference = {40, 104, 214};
constexpr Color kCurrent = {226, 62, 46};
constexpr Color kAgree = {176, 160, 190};

/// Colour where both surfaces are present: from "agree" to the upper surface's colour within four
/// tolerances.
Color BothColor(double current_minus_reference_m, double tolerance_m) {
  const double excess =
      std::clamp((std::abs(current_minus_reference_m) - tolerance_m) / (3 * tolerance_m), 0.0, 1.0);
  return Mix(kAgree, current_minus_reference_m > 0 ? kCurrent : kReference,
             excess * (2.0 - excess));
}

void DrawLegend(Figure& figure, const cv::Rect& area, double tolerance_m,
                const PictureWords& words) {
  const double x = area.x;
  const std::string tolerance =
      WithDecimalSign(fmt::format("{:.3g}", tolerance_m / kMillimetre), words);
  figure.Text(x, area.y + 14, words.surface_on_top, {.size_px = 18, .color = kInk, .bold = true});
  double y = area.y + 34;
  y = DrawSwatch(figure, x, y, area.width, kReference, words.reference);
  y = DrawSwatch(figure, x, y, area.width, kCurrent, words.current);
  y = DrawSwatch(figure, x, y, area.width, kAgree,
                 fmt::format(fmt::runtime(words.both_within), tolerance));
  DrawSwatch(figure, x, y, area.width, kHoleColor, words.not_in_either);
}

}  // namespace

cv::Mat DrawOverlayImage(const HeightMap& reference, const HeightMap& current,
                         const OverlayImageOptions& options) {
  if (!(reference.grid == current.grid))
    throw std::invalid_argument("an overlay needs both height maps on one grid");
  if (!(options.tolerance_m > 0))
    throw std::invalid_argument(
        fmt::format("an overlay needs a tolerance above 0 m, found {}", options.tolerance_m));
  if (!options.region_mask.empty() && options.region_mask.size() != reference.grid.num_cells())
    throw std::invalid_argument("the region of an overlay lies on another grid");
  const cv::Rect cells = CellsAroundRegion(
      reference.grid, CellsWithData(reference.grid, {reference.z, current.z}), options.region_mask);
  const cv::Mat reference_relief = Relief(reference, cells),
                current_relief = Relief(current, cells);
  cv::Mat picture(cells.height, cells.width, CV_8UC3);
  for (int row = 0; row < cells.height; ++row) {
    auto* out = picture.ptr<cv::Vec3b>(row);
    for (int column = 0; column < cells.width; ++column) {
      const float a = reference.at(cells.y + row, cells.x + column),
                  b = current.at(cells.y + row, cells.x + column);
      const bool has_a = std::isfinite(a), has_b = std::isfinite(b);
      Color color = kHoleColor;
      double light = 1.0;
      if (has_a && has_b) color = BothColor(static_cast<double>(b) - a, options.tolerance_m);
      if (has_a != has_b) color = has_a ? kReference : kCurrent;
      if (has_a || has_b)
        light = has_b && (!has_a || b > a) ? current_relief.at<float>(row, column)
                                           : reference_relief.at<float>(row, column);
      for (int channel = 0; channel < 3; ++channel) {
        out[column][channel] = static_cast<std::uint8_t>(
            std::min(255L, std::lround(color[static_cast<std::size_t>(channel)] * light)));
      }
    }
  }
  return DrawPage({.title = std::string(options.words.overlay_title),
                   .subtitle = options.subtitle,
                   .grid = Part(reference.grid, cells),
                   .cells_rgb = picture,
                   .outline = {},
                   .draw_legend =
                       [&](Figure& figure, const cv::Rect& area) {
                         DrawLegend(figure, area, options.tolerance_m, options.words);
                       },
                   .marks = options.marks,
                   .words = options.words});
}

}  // namespace plumb
