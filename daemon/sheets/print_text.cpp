// SPDX-License-Identifier: Apache-2.0
#include "daemon/sheets/print_text.hpp"

#include <cairo.h>
#include <pango/pangocairo.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>

#include "algo/base/utf8.hpp"

namespace plumb {
namespace {

constexpr double kUnbounded = -1.0;

/// A letter of Hebrew, Arabic and their neighbours.
bool IsRightToLeft(std::uint32_t code) {
  return (code >= 0x0590 && code < 0x0900) || (code >= 0xFB1D && code < 0xFE00) ||
         (code >= 0xFE70 && code < 0xFF00);
}

/// Plain UTF-8 in which a mark of direction ends each name that is written from right to left:
/// otherwise the date behind its comma would be turned around with it.
std::string Ordered(std::string_view text) {
  constexpr std::string_view kLeftToRight = "\u200E", kEnds = ",;:()[]";
  const std::string valid = ValidUtf8(text);
  std::string ordered;
  bool is_after_name = false;
  for (std::string_view rest = valid; !rest.empty();) {
    std::uint32_t code = 0;
    const std::size_t length = std::max<std::size_t>(Utf8Length(rest, code), 1);
    if (is_after_name && kEnds.find(rest.front()) != std::string_view::npos)
      ordered += kLeftToRight;
    is_after_name = IsRightToLeft(code);
    ordered += rest.substr(0, length);
    rest.remove_prefix(length);
  }
  return ordered;
}

}  // namespace

PrintText::PrintText(cairo_t* cairo) : cairo_(cairo), layout_(pango_cairo_create_layout(cairo)) {
  PangoContext* const context = pango_layout_get_context(layout_);
  // Nothing is rounded to the pixels of a screen: a page has the same breaks at each resolution.
  const std::unique_ptr<cairo_font_options_t, decltype(&cairo_font_options_destroy)> options(
      cairo_font_options_create(), &cairo_font_options_destroy);
  cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_OFF);
  cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_NONE);
  pango_cairo_context_set_font_options(context, options.get());
  pango_context_set_round_glyph_positions(context, FALSE);
  // A line of a report that begins with an Arabic name is still one of a report in English.
  pango_context_set_base_dir(context, PANGO_DIRECTION_LTR);
  pango_layout_set_auto_dir(layout_, FALSE);
  // A hyphen inserted at a line break would be read as part of a patient's code.
  const std::unique_ptr<PangoAttrList, decltype(&pango_attr_list_unref)> attributes(
      pango_attr_list_new(), &pango_attr_list_unref);
  pango_attr_list_insert(attributes.get(), pango_attr_insert_hyphens_new(FALSE));
  pango_layout_set_attributes(layout_, attributes.get());
}

PrintText::~PrintText() { g_object_unref(layout_); }

void PrintText::Lay(std::string_view text, const TextStyle& style, double width) const {
  const std::unique_ptr<PangoFontDescription, decltype(&pango_font_description_free)> font(
      pango_font_description_from_string(kPrintFamily), &pango_font_description_free);
  pango_font_description_set_absolute_size(font.get(), style.size * PANGO_SCALE);
  if (style.is_bold) pango_font_description_set_weight(font.get(), PANGO_WEIGHT_BOLD);
  pango_layout_set_font_description(layout_, font.get());
  const std::string ordered = Ordered(text);
  pango_layout_set_text(layout_, ordered.data(), static_cast<int>(ordered.size()));
  pango_layout_set_width(layout_,
                         width < 0 ? -1 : static_cast<int>(std::floor(width * PANGO_SCALE)));
  pango_layout_set_wrap(layout_, PANGO_WRAP_WORD_CHAR);
  pango_cairo_update_layout(cairo_, layout_);
}

double PrintText::Width(std::string_view text, const TextStyle& style) const {
  pango_layout_set_single_paragraph_mode(layout_, TRUE);
  pango_layout_set_ellipsize(layout_, PANGO_ELLIPSIZE_NONE);
  Lay(text, style, kUnbounded);
  PangoRectangle extent;
  pango_layout_get_extents(layout_, nullptr, &extent);
  return static_cast<double>(extent.width) / PANGO_SCALE;
}

void PrintText::Line(double x, double baseline, std::string_view text, const TextStyle& style,
                     double most) const {
  pango_layout_set_single_paragraph_mode(layout_, TRUE);
  pango_layout_set_ellipsize(layout_, PANGO_ELLIPSIZE_END);
  Lay(text, style, std::max(most, 0.0));
  cairo_move_to(cairo_, x, baseline);
  pango_cairo_show_layout_line(cairo_, pango_layout_get_line_readonly(layout_, 0));
}

int PrintText::Paragraph(double x, double baseline, double step, double width,
                         std::string_view text, const TextStyle& style) const {
  pango_layout_set_single_paragraph_mode(layout_, FALSE);
  pango_layout_set_ellipsize(layout_, PANGO_ELLIPSIZE_NONE);
  Lay(text, style, std::max(width, style.size));
  const int lines = text.empty() ? 0 : pango_layout_get_line_count(layout_);
  for (int i = 0; i < lines; ++i) {
    cairo_move_to(cairo_, x, baseline + i * step);
    pango_cairo_show_layout_line(cairo_, pango_layout_get_line_readonly(layout_, i));
  }
  return lines;
}

}  // namespace plumb
