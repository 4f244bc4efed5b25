// SPDX-License-Identifier: Apache-2.0
#include "algo/render/figure.hpp"

#include <cairo.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include <fmt/format.h>

namespace plumb {

struct Figure::Impl {
  cairo_surface_t* surface = nullptr;
  cairo_t* context = nullptr;
  ~Impl() {
    cairo_destroy(context);
    cairo_surface_destroy(surface);
  }
  void Set(const Color& color, double opacity = 1.0) const {
    cairo_set_source_rgba(context, color[0] / 255.0, color[1] / 255.0, color[2] / 255.0, opacity);
  }
  void Set(const TextStyle& style) const {
    cairo_select_font_face(context, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           style.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(context, style.size_px);
    Set(style.color);
  }
};

Figure::Figure(int width, int height) : impl_(std::make_unique<Impl>()) {
  impl_->surface = cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height);
  impl_->context = cairo_create(impl_->surface);
  if (cairo_status(impl_->context) != CAIRO_STATUS_SUCCESS) {
    throw std::invalid_argument(fmt::format("cannot draw a picture of {} x {} pixels: {}", width,
                                            height,
                                            cairo_status_to_string(cairo_status(impl_->context))));
  }
  FillRectangle(0, 0, width, height, {255, 255, 255});
}

Figure::~Figure() = default;

double Figure::TextWidth(std::string_view text, const TextStyle& style) {
  impl_->Set(style);
  cairo_text_extents_t extents;
  cairo_text_extents(impl_->context, std::string(text).c_str(), &extents);
  return extents.x_advance;
}

void Figure::Text(double x, double y, std::string_view text, const TextStyle& style) {
  const double width = style.align == HorizontalAlign::kLeft ? 0.0 : TextWidth(text, style);
  impl_->Set(style);
  cairo_move_to(impl_->context, x - (style.align == HorizontalAlign::kCentre ? width / 2 : width),
                y);
  cairo_show_text(impl_->context, std::string(text).c_str());
}

std::vector<std::string> Figure::Wrap(std::string_view text, const TextStyle& style, double width) {
  std::vector<std::string> lines(1);
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(' '), text.size());
    const std::string word(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::string longer = lines.back().empty() ? word : lines.back() + ' ' + word;
    if (lines.back().empty() || TextWidth(longer, style) <= width) {
      lines.back() = longer;
    } else {
      lines.push_back(word);
    }
  }
  return lines;
}

void Figure::FillRectangle(double x, double y, double width, double height, const Color& color,
                           double opacity) {
  impl_->Set(color, opacity);
  cairo_rectangle(impl_->context, x, y, width, height);
  cairo_fill(impl_->context);
}

void Figure::FrameRectangle(double x, double y, double width, double height, const Color& color,
                            double line_width) {
  impl_->Set(color);
  cairo_set_line_width(impl_->context, line_width);
  cairo_rectangle(impl_->context, x, y, width, height);
  cairo_stroke(impl_->context);
}

void Figure::Line(double x0, double y0, double x1, double y1, const Color& color, double line_width,
                  double opacity) {
  impl_->Set(color, opacity);
  cairo_set_line_width(impl_->context, line_width);
  cairo_move_to(impl_->context, x0, y0);
  cairo_line_to(impl_->context, x1, y1);
  cairo_stroke(impl_->context);
}

void Figure::Picture(int x, int y, const cv::Mat& picture_rgb) {
  CV_Assert(picture_rgb.type() == CV_8UC3);
  cairo_surface_flush(impl_->surface);
  unsigned char* const data = cairo_image_surface_get_data(impl_->surface);
  const int stride = cairo_image_surface_get_stride(impl_->surface);
  const int first_column = std::max(0, -x), last_column = std::min(picture_rgb.cols, width() - x);
  for (int row = std::max(0, -y); row < std::min(picture_rgb.rows, height() - y); ++row) {
    const unsigned char* from = picture_rgb.ptr<unsigned char>(row);
    auto* to =
        reinterpret_cast<std::uint32_t*>(data + static_cast<std::ptrdiff_t>(row + y) * stride);
    for (int column = first_column; column < last_column; ++column) {
      const unsigned char* p = from + static_cast<std::ptrdiff_t>(3) * column;
      to[column + x] =
          (std::uint32_t{p[0]} << 16) | (std::uint32_t{p[1]} << 8) | std::uint32_t{p[2]};
    }
  }
  cairo_surface_mark_dirty(impl_->surface);
}

int Figure::width() const { return cairo_image_surface_get_width(impl_->surface); }
int Figure::height() const { return cairo_image_surface_get_height(impl_->surface); }

cv::Mat Figure::ToRgb() const {
  cairo_surface_flush(impl_->surface);
  const unsigned char* const data = cairo_image_surface_get_data(impl_->surface);
  const int stride = cairo_image_surface_get_stride(impl_->surface);
  cv::Mat picture(height(), width(), CV_8UC3);
  for (int row = 0; row < picture.rows; ++row) {
    const auto* from =
        reinterpret_cast<const std::uint32_t*>(data + static_cast<std::ptrdiff_t>(row) * stride);
    unsigned char* to = picture.ptr<unsigned char>(row);
    for (int column = 0; column < picture.cols; ++column) {
      *to++ = static_cast<unsigned char>(from[column] >> 16);
      *to++ = static_cast<unsigned char>(from[column] >> 8);
      *to++ = static_cast<unsigned char>(from[column]);
    }
  }
  return picture;
}

}  // namespace plumb
