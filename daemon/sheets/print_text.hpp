// SPDX-License-Identifier: Apache-2.0
// Text on paper, laid out by Pango: names in every script that a font of the system has, shaped and
// ordered as that script is, and never wider than their place.
#pragma once

#include <string>
#include <string_view>

using cairo_t = struct _cairo;
using PangoLayout = struct _PangoLayout;

namespace plumb {

/// What DejaVu lacks comes from the other fonts that are installed.
inline constexpr const char* kPrintFamily = "DejaVu Sans, sans-serif";

struct TextStyle {
  double size = 8.0;  ///< In the units of the page.
  bool is_bold = false;
};

/// Lengths in the units of the cairo context, which outlives this; its colour is used. What is no
/// UTF-8 is shown as U+FFFD. Lines run from left to right, with what is written from right to left
/// in its own order.
class PrintText {
 public:
  explicit PrintText(cairo_t* cairo);
  ~PrintText();
  PrintText(const PrintText&) = delete;
  PrintText& operator=(const PrintText&) = delete;

  [[nodiscard]] double Width(std::string_view text, const TextStyle& style) const;
  /// One line, which ends in an ellipsis where it is wider than `most`.
  void Line(double x, double baseline, std::string_view text, const TextStyle& style,
            double most) const;
  /// Lines of that width, broken between words, or within a word that is wider than a line.
  /// @param step  Between two lines.
  /// @return How many lines were drawn.
  int Paragraph(double x, double baseline, double step, double width, std::string_view text,
                const TextStyle& style) const;

 private:
  void Lay(std::string_view text, const TextStyle& style, double width) const;

  cairo_t* cairo_;
  PangoLayout* layout_;
};

}  // namespace plumb
