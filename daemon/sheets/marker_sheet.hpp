// SPDX-License-Identifier: Apache-2.0
// Printable sheets of markers at true size.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/message.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/marker_dictionary.hpp"

using cairo_surface_t = struct _cairo_surface;

namespace plumb {

struct SheetOptions {
  std::string dictionary = kDefaultMarkerDictionary;
  std::vector<int> ids;                      ///< In the order in which they are drawn.
  double length_m = kDefaultMarkerLength_m;  ///< Side of the black square.
  std::string paper = "A4";                  ///< A4, A3, Letter or Tabloid, upright.
  /// The room calibration board (algo/comparison/room_board.hpp): its ids and paper size replace
  /// the two values above.
  bool is_board = false;
  const Catalogue* language = nullptr;  ///< Of what is printed beside the markers; null: English.
};

/// Position of a marker on its page: millimetres from the page's top left corner, y down.
struct PlacedMarker {
  int id = 0;
  double left_mm = 0.0;  ///< Of the black square.
  double top_mm = 0.0;
};

/// Pages of markers, each with its id, an arrow that points up in the print and a white margin of
/// at least one cell; each page has a ruler of 100 mm to check the printer's scale. The board also
/// has lines for the room's lasers and an arrow to the gantry. Immutable.
class MarkerSheet {
 public:
  /// @throws InvalidRequest for an unknown dictionary or paper, ids that the dictionary does
  ///         not have, no ids or more than 1000, or a marker that is larger than the paper; the
  ///         message states what fits.
  explicit MarkerSheet(const SheetOptions& options);

  [[nodiscard]] int num_pages() const { return static_cast<int>(pages_.size()); }
  [[nodiscard]] double width_mm() const { return width_mm_; }
  [[nodiscard]] double height_mm() const { return height_mm_; }
  [[nodiscard]] const std::vector<PlacedMarker>& markers(int page) const {
    return pages_.at(static_cast<std::size_t>(page));
  }

  /// All pages as one PDF. @throws IoError
  void WritePdf(const std::filesystem::path& file) const;
  /// The same as bytes. @throws IoError
  [[nodiscard]] std::string Pdf() const;
  /// One page as SVG. @throws IoError
  void WriteSvg(const std::filesystem::path& file, int page) const;
  /// One page as a picture, CV_8UC3.
  [[nodiscard]] cv::Mat Rasterise(int page, double dots_per_inch) const;

 private:
  struct Canvas;
  void DrawPages(cairo_surface_t* surface) const;
  void Lay();
  void LayBoard();
  [[nodiscard]] double CrossHeight() const;  ///< Millimetres from the page's top.
  [[nodiscard]] std::string Said(const Message& message) const;
  void Draw(const Canvas& canvas, int page) const;
  void DrawMarker(const Canvas& canvas, const PlacedMarker& marker) const;
  void DrawCross(const Canvas& canvas) const;
  void DrawRuler(const Canvas& canvas, int page) const;

  SheetOptions options_;
  MarkerDictionary dictionary_;
  double width_mm_ = 0.0;
  double height_mm_ = 0.0;
  std::vector<std::vector<PlacedMarker>> pages_;
};

/// Parses "0-15,20". @throws InvalidRequest stating what is expected.
[[nodiscard]] std::vector<int> ParseIds(std::string_view text);

}  // namespace plumb
