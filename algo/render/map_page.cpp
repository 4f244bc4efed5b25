// SPDX-License-Identifier: Apache-2.0
#include "algo/render/map_page.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

constexpr Color kNoticeInk = {122, 28, 10};
constexpr Color kMarkInk = {20, 60, 90};
constexpr Color kNoticePaper = {253, 240, 222};

constexpr int kMapWidth_px = 1240, kMapHeight_px = 940;  // space for the map
constexpr int kMinMapHeight_px = 520;                    // leaves space for the legend beside it
constexpr int kLeft_px = 84, kTop_px = 108, kLegend_px = 236, kAxis_px = 62, kGap_px = 28;

/// The largest length of 1, 2 or 5 times a power of ten that is not above `length_m`.
double RoundLength(double length_m) {
  const double power = std::pow(10.0, std::floor(std::log10(length_m) + 1e-9));
  for (const double step : {5.0, 2.0}) {
    if (step * power <= length_m * (1 + 1e-9)) return step * power;
  }
  return power;
}

std::string LengthLabel(double length_m, const PictureWords& words) {
  return WithDecimalSign(length_m < 0.995 ? fmt::format("{:.3g} cm", length_m / kCentimetre)
                                          : fmt::format("{:.3g} m", length_m),
                         words);
}

/// Position of the map on the page and mapping from cells to pixels.
struct MapArea {
  cv::Rect box;
  GridShape grid;
  [[nodiscard]] double px_per_m() const { return box.width / (grid.width * grid.step); }
  [[nodiscard]] double PixelX(double x_m) const { return box.x + (x_m - grid.x_min) * px_per_m(); }
  [[nodiscard]] double PixelY(double y_m) const {
    return box.y + box.height - (y_m - grid.y_min) * px_per_m();
  }
};

cv::Mat ScaledMap(const MapPage& page, const cv::Size& size) {
  cv::Mat upright, scaled;
  cv::flip(page.cells_rgb, upright, 0);
  cv::resize(upright, scaled, size, 0, 0,
             size.width < upright.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
  if (!page.outline.empty()) {
    cv::Mat mask(page.grid.height, page.grid.width, CV_8UC1,
                 const_cast<std::uint8_t*>(page.outline.data()));
    cv::Mat edge;
    cv::flip(mask, edge, 0);
    cv::resize(edge, edge, size, 0, 0, cv::INTER_NEAREST);
    cv::morphologyEx(edge, edge, cv::MORPH_GRADIENT,
                     cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3}));
    scaled.setTo(cv::Scalar(kInk[0], kInk[1], kInk[2]), edge);
  }
  return scaled;
}

void DrawAxes(Figure& figure, const MapArea& area, const PictureWords& words) {
  const GridShape& grid = area.grid;
  const double step_m = RoundLength(std::max(0.02, 190.0 / area.px_per_m()));
  const TextStyle label{.size_px = 16, .color = kFaint, .align = HorizontalAlign::kCentre};
  const double bottom = area.box.y + area.box.height;
  const auto text = [](double value) {
    return fmt::format("{:.1f}", std::abs(value) < 1e-9 ? 0.0 : value);
  };
  const auto fine = [](double value) {
    return fmt::format("{:.2f}", std::abs(value) < 1e-9 ? 0.0 : value);
  };
  const auto format = [&](double value) {
    return WithDecimalSign(step_m < 0.095 ? fine(value) : text(value), words);
  };
  for (double i = std::ceil(grid.x_min / step_m); i * step_m <= grid.x_min + grid.width * grid.step;
       ++i) {
    const double x = area.PixelX(i * step_m);
    figure.Line(x, area.box.y, x, bottom, kInk, 1.0, 0.13);
    figure.Line(x, bottom, x, bottom + 6, kFaint, 1.5);
    figure.Text(x, bottom + 25, format(i * step_m), label);
  }
  TextStyle left = label;
  left.align = HorizontalAlign::kRight;
  for (double i = std::ceil(grid.y_min / step_m);
       i * step_m <= grid.y_min + grid.height * grid.step; ++i) {
    const double y = area.PixelY(i * step_m);
    figure.Line(area.box.x, y, area.box.x + area.box.width, y, kInk, 1.0, 0.13);
    figure.Line(area.box.x - 6, y, area.box.x, y, kFaint, 1.5);
    figure.Text(area.box.x - 11, y + 6, format(i * step_m), left);
  }
  figure.FrameRectangle(area.box.x - 0.5, area.box.y - 0.5, area.box.width + 1, area.box.height + 1,
                        kFaint);
  figure.Text(area.box.x + area.box.width / 2.0, bottom + 49, words.x_axis, label);
  // Above the axis, where it cannot collide with a tick label.
  figure.Text(area.box.x - 11, area.box.y - 15, words.y_axis, left);
}

void DrawScaleBar(Figure& figure, const MapArea& area, const PictureWords& words) {
  const double length_m = RoundLength(0.22 * area.box.width / area.px_per_m());
  const double length_px = length_m * area.px_per_m();
  const double x = area.box.x + 20, y = area.box.y + area.box.height - 62;
  figure.FillRectangle(x - 6, y - 6, length_px + 36, 56, {255, 255, 255}, 0.86);
  figure.Text(x + 12 + length_px / 2, y + 17, LengthLabel(length_m, words),
              {.size_px = 17, .color = kInk, .bold = true, .align = HorizontalAlign::kCentre});
  figure.FillRectangle(x + 12, y + 28, length_px, 7, kInk);
  for (const double end : {x + 12, x + 12 + length_px})
    figure.Line(end, y + 23, end, y + 40, kInk, 2.5);
}

/// Draws a mark where the line from the middle of the map in that direction meets its edge, or on
/// that line within the marks that are there already.
/// @param taken  Places of the marks; this one is added.
void DrawMark(Figure& figure, const MapArea& area, const MapMark& mark,
              std::vector<cv::Rect2d>& taken) {
  const Eigen::Vector2d half(area.box.width / 2.0, area.box.height / 2.0);
  const Eigen::Vector2d way(mark.toward.x(), -mark.toward.y());
  double reach = std::numeric_limits<double>::infinity();
  for (const int axis : {0, 1}) {
    if (std::abs(way[axis]) > 0.3) reach = std::min(reach, half[axis] / std::abs(way[axis]));
  }
  const TextStyle style{
      .size_px = 19, .color = kMarkInk, .bold = true, .align = HorizontalAlign::kCentre};
  const double width = figure.TextWidth(mark.name, style) + 18, height = 30;
  if (!std::isfinite(reach) || width > area.box.width || height > area.box.height) return;
  double x = std::clamp(area.box.x + half.x() + reach * way.x(), area.box.x + width / 2 + 3,
                        area.box.x + area.box.width - width / 2 - 3);
  double y = std::clamp(area.box.y + half.y() + reach * way.y(), area.box.y + height / 2 + 3,
                        area.box.y + area.box.height - height / 2 - 3);
  const auto place = [&] { return cv::Rect2d(x - width / 2, y - height / 2, width, height); };
  const auto is_taken = [&] {
    return std::ranges::any_of(
        taken, [&](const cv::Rect2d& other) { return (place() & other).area() > 0; });
  };
  for (double moved = 0; moved < reach && is_taken(); ++moved) x -= way.x(), y -= way.y();
  taken.push_back(place());
  figure.FillRectangle(x - width / 2, y - height / 2, width, height, {255, 255, 255}, 0.88);
  figure.FrameRectangle(x - width / 2, y - height / 2, width, height, kMarkInk, 1.5);
  figure.Text(x, y + 7, mark.name, style);
}

void DrawCross(Figure& figure, const MapArea& area, const Eigen::Vector2d& at_m,
               const PictureWords& words) {
  const double x = area.PixelX(at_m.x()), y = area.PixelY(at_m.y());
  if (!area.box.contains(cv::Point(static_cast<int>(x), static_cast<int>(y)))) return;
  for (const auto& [color, line_width] : {std::pair{Color{255, 255, 255}, 5.0}, {kInk, 2.0}}) {
    figure.Line(x - 16, y, x + 16, y, color, line_width);
    figure.Line(x, y - 16, x, y + 16, color, line_width);
  }
  const TextStyle style{.size_px = 16, .color = kInk, .bold = true};
  const double width = figure.TextWidth(words.isocentre, style) + 12;
  const double left = x + 20 + width > area.box.x + area.box.width ? x - 20 - width : x + 20;
  figure.FillRectangle(left, y - 13, width, 26, {255, 255, 255}, 0.86);
  figure.Text(left + 6, y + 6, words.isocentre, style);
}

void DrawTitle(Figure& figure, const MapPage& page) {
  const double width = figure.width() - 2 * 24;
  TextStyle title{.size_px = 28, .color = kInk, .bold = true};
  while (title.size_px > 14 && figure.TextWidth(page.title, title) > width) title.size_px -= 1;
  figure.Text(24, 42, page.title, title);
  TextStyle subtitle{.size_px = 18, .color = kFaint};
  while (subtitle.size_px > 11 && figure.TextWidth(page.subtitle, subtitle) > width)
    subtitle.size_px -= 0.5;
  figure.Text(24, 72, page.subtitle, subtitle);
}

}  // namespace

cv::Rect CellsWithData(const GridShape& grid, std::initializer_list<std::span<const float>> maps) {
  int x0 = grid.width, x1 = -1, y0 = grid.height, y1 = -1;
  for (const std::span<const float> map : maps) {
    for (int row = 0; row < grid.height; ++row) {
      const float* z =
          map.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.width);
      int first = 0, last = grid.width - 1;
      while (first <= last && !std::isfinite(z[first])) ++first;
      if (first > last) continue;
      while (!std::isfinite(z[last])) --last;
      x0 = std::min(x0, first), x1 = std::max(x1, last);
      y0 = std::min(y0, row), y1 = std::max(y1, row);
    }
  }
  const cv::Rect whole(0, 0, grid.width, grid.height);
  if (x1 < 0) return whole;
  const int margin = static_cast<int>(std::lround(0.03 / grid.step));
  return cv::Rect(x0 - margin, y0 - margin, x1 - x0 + 1 + 2 * margin, y1 - y0 + 1 + 2 * margin) &
         whole;
}

cv::Rect CellsAroundRegion(const GridShape& grid, const cv::Rect& with_data,
                           std::span<const std::uint8_t> region) {
  constexpr double kMargin_m = 0.1;
  if (region.empty()) return with_data;
  const cv::Mat mask(grid.height, grid.width, CV_8UC1, const_cast<std::uint8_t*>(region.data()));
  const cv::Rect box = cv::boundingRect(mask);
  if (box.empty()) return with_data;
  const int margin = static_cast<int>(std::lround(kMargin_m / grid.step));
  const cv::Rect around(box.x - margin, box.y - margin, box.width + 2 * margin,
                        box.height + 2 * margin);
  const cv::Rect shown = around & with_data;
  return shown.empty() ? with_data : shown;
}

GridShape Part(const GridShape& grid, const cv::Rect& cells) {
  return {.x_min = grid.x_min + cells.x * grid.step,
          .y_min = grid.y_min + cells.y * grid.step,
          .step = grid.step,
          .width = cells.width,
          .height = cells.height};
}

cv::Mat Relief(const HeightMap& heights, const cv::Rect& cells) {
  // Light from the upper left of the picture at an elevation of 45 degrees.
  const Eigen::Vector3f light = Eigen::Vector3f(-1.0F, 1.0F, 1.4F).normalized();
  constexpr float kAmbient = 0.40F;
  cv::Mat relief(cells.height, cells.width, CV_32FC1, cv::Scalar(1.0));
  const auto step = static_cast<float>(heights.grid.step);
  for (int row = 0; row < cells.height; ++row) {
    auto* out = relief.ptr<float>(row);
    const int y = cells.y + row;
    if (y == 0 || y + 1 >= heights.grid.height) continue;
    for (int column = 0; column < cells.width; ++column) {
      const int x = cells.x + column;
      if (x == 0 || x + 1 >= heights.grid.width) continue;
      const float dx = (heights.at(y, x + 1) - heights.at(y, x - 1)) / (2 * step);
      const float dy = (heights.at(y + 1, x) - heights.at(y - 1, x)) / (2 * step);
      if (!std::isfinite(dx + dy)) continue;
      const float cosine =
          (-dx * light.x() - dy * light.y() + light.z()) / std::sqrt(dx * dx + dy * dy + 1.0F);
      out[column] = kAmbient + (1.0F - kAmbient) * std::max(0.0F, cosine) / light.z();
    }
  }
  return relief;
}

std::vector<std::uint8_t> PartOfMask(const GridShape& grid, const cv::Rect& cells,
                                     std::span<const std::uint8_t> mask) {
  std::vector<std::uint8_t> part;
  if (mask.empty()) return part;
  for (int row = cells.y; row < cells.y + cells.height; ++row) {
    const auto first = mask.begin() + static_cast<std::ptrdiff_t>(row) * grid.width + cells.x;
    part.insert(part.end(), first, first + cells.width);
  }
  return part;
}

std::string WithDecimalSign(std::string number, const PictureWords& words) {
  std::replace(number.begin(), number.end(), '.', words.decimal);
  return number;
}

cv::Vec3b CellColor(const Color& color, double shade, bool is_outside) {
  constexpr double kPaleOutside = 0.45;  // fraction of white
  cv::Vec3b cell;
  for (int channel = 0; channel < 3; ++channel) {
    const double value = color[static_cast<std::size_t>(channel)] * shade;
    cell[channel] = static_cast<std::uint8_t>(
        std::lround(value + (is_outside ? kPaleOutside : 0.0) * (255.0 - value)));
  }
  return cell;
}

constexpr double kBarWidth_px = 44;

void DrawColorBar(Figure& figure, double x, double y, double height,
                  const std::function<Color(double position)>& color_at) {
  for (int i = 0; i < static_cast<int>(height); ++i)
    figure.FillRectangle(x, y + i, kBarWidth_px, 1.02, color_at(1.0 - (i + 0.5) / height));
  figure.FrameRectangle(x, y, kBarWidth_px, height, kFaint);
}

void DrawTick(Figure& figure, double x, double y, std::string_view label, bool is_bold) {
  const double right = x + kBarWidth_px;
  figure.Line(right, y, right + 8, y, kInk, is_bold ? 2.5 : 1.2);
  figure.Text(right + 14, y + 6, label, {.size_px = 17, .bold = is_bold});
}

double DrawSwatch(Figure& figure, double x, double y, double width, const cv::Mat& picture_rgb,
                  std::string_view meaning) {
  const TextStyle style{.size_px = 16, .color = kInk};
  figure.Picture(static_cast<int>(std::lround(x)), static_cast<int>(std::lround(y)), picture_rgb);
  figure.FrameRectangle(x, y, kSwatch_px, kSwatch_px, kFaint);
  double baseline = y + 18;
  for (const std::string& line : figure.Wrap(meaning, style, width - kSwatch_px - 10)) {
    figure.Text(x + kSwatch_px + 10, baseline, line, style);
    baseline += 20;
  }
  return std::max(y + kSwatch_px, baseline - 14) + 12;
}

double DrawSwatch(Figure& figure, double x, double y, double width, const Color& color,
                  std::string_view meaning) {
  const cv::Mat plain(kSwatch_px, kSwatch_px, CV_8UC3, cv::Scalar(color[0], color[1], color[2]));
  return DrawSwatch(figure, x, y, width, plain, meaning);
}

cv::Mat DrawPage(const MapPage& page) {
  if (page.grid.width <= 0 || page.grid.height <= 0)
    throw std::invalid_argument("a picture needs a grid with at least one cell");
  const double scale = std::min(static_cast<double>(kMapWidth_px) / page.grid.width,
                                static_cast<double>(kMapHeight_px) / page.grid.height);
  const cv::Size map_size(std::max(1, static_cast<int>(std::lround(scale * page.grid.width))),
                          std::max(1, static_cast<int>(std::lround(scale * page.grid.height))));
  const int content_width = std::max(map_size.width, 620);
  const int body_height = std::max(map_size.height, kMinMapHeight_px);
  const int width = kLeft_px + content_width + kGap_px + kLegend_px + 12;

  const TextStyle notice_style{
      .size_px = 19, .color = kNoticeInk, .bold = true, .align = HorizontalAlign::kCentre};
  const std::vector<std::string> notice =
      Figure(8, 8).Wrap(page.words.notice, notice_style, width - 48);
  const int notice_height = 20 + 27 * static_cast<int>(notice.size());
  Figure figure(width, kTop_px + body_height + kAxis_px + notice_height);

  const MapArea area{.box = cv::Rect(kLeft_px + (content_width - map_size.width) / 2,
                                     kTop_px + (body_height - map_size.height) / 2, map_size.width,
                                     map_size.height),
                     .grid = page.grid};
  figure.Picture(area.box.x, area.box.y, ScaledMap(page, map_size));
  DrawAxes(figure, area, page.words);
  DrawScaleBar(figure, area, page.words);
  if (page.cross_m) DrawCross(figure, area, *page.cross_m, page.words);
  std::vector<cv::Rect2d> taken;
  for (const MapMark& mark : page.marks) DrawMark(figure, area, mark, taken);
  DrawTitle(figure, page);
  if (page.draw_legend)
    page.draw_legend(
        figure, cv::Rect(kLeft_px + content_width + kGap_px, kTop_px, kLegend_px, body_height));

  const double top = figure.height() - notice_height;
  figure.FillRectangle(0, top, width, notice_height, kNoticePaper);
  figure.Line(0, top, width, top, kNoticeInk, 2.0);
  for (std::size_t i = 0; i < notice.size(); ++i)
    figure.Text(width / 2.0, top + 30 + 27.0 * static_cast<double>(i), notice[i], notice_style);
  return figure.ToRgb();
}

}  // namespace plumb
