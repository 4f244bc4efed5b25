// SPDX-License-Identifier: Apache-2.0
// A page for drawing antialiased text, lines and pictures.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/render/color_scale.hpp"
#include "algo/types/height_map.hpp"

namespace plumb {

inline constexpr Color kInk = {33, 37, 41};
inline constexpr Color kFaint = {92, 99, 106};

enum class HorizontalAlign { kLeft, kCentre, kRight };

struct TextStyle {
  double size_px = 18;
  Color color = kInk;
  bool bold = false;
  HorizontalAlign align = HorizontalAlign::kLeft;
};

/// Pixels from the top left corner, y down. Not thread-safe.
class Figure {
 public:
  Figure(int width, int height);
  ~Figure();

  /// Text with its baseline at y.
  void Text(double x, double y, std::string_view text, const TextStyle& style);
  [[nodiscard]] double TextWidth(std::string_view text, const TextStyle& style);
  /// Splits a text into lines that fit the width.
  [[nodiscard]] std::vector<std::string> Wrap(std::string_view text, const TextStyle& style,
                                              double width);

  void FillRectangle(double x, double y, double width, double height, const Color& color,
                     double opacity = 1.0);
  void FrameRectangle(double x, double y, double width, double height, const Color& color,
                      double line_width = 1.0);
  void Line(double x0, double y0, double x1, double y1, const Color& color, double line_width = 1.0,
            double opacity = 1.0);

  /// Draws an RGB picture with its top left corner at (x, y), pixel for pixel.
  void Picture(int x, int y, const cv::Mat& picture_rgb);

  [[nodiscard]] int width() const;
  [[nodiscard]] int height() const;
  [[nodiscard]] cv::Mat ToRgb() const;  ///< CV_8UC3

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
