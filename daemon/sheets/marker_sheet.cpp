// SPDX-License-Identifier: Apache-2.0
#include "daemon/sheets/marker_sheet.hpp"

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>

#include "algo/base/errors.hpp"
#include "algo/base/notice.hpp"
#include "algo/base/units.hpp"
#include "algo/comparison/room_board.hpp"
#include "daemon/sheets/paper.hpp"
#include "daemon/sheets/print_text.hpp"
#include "words/file.hpp"
#include "words/sheet.hpp"

namespace plumb {
namespace {

constexpr double kMargin_mm = 6.0;   // printers leave about 5 mm white
constexpr double kFooter_mm = 22.0;  // ruler and notice
constexpr double kLabel_mm =
    5.5;  // below each marker, in the outer part of the white margin if that is wide enough
constexpr double kLabelBegin = 0.45;  // fraction of the white margin of one cell, from the marker
constexpr double kRuler_mm = 100.0;
constexpr std::size_t kMaxIds = 1000;
constexpr double kTextGrey = 0.45;

struct SurfaceCloser {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
using CairoSurface = std::unique_ptr<cairo_surface_t, SurfaceCloser>;

MarkerDictionary Dictionary(const std::string& name) try {
  return MarkerDictionary::ByName(name);
} catch (const DataError& error) {
  throw InvalidRequest(error.message());
}

cairo_status_t Append(void* bytes, const unsigned char* data, unsigned length) {
  static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

/// @throws IoError if the surface was not written whole.
void Finish(const CairoSurface& surface, const std::filesystem::path& file) {
  cairo_surface_finish(surface.get());
  if (const cairo_status_t status = cairo_surface_status(surface.get());
      status != CAIRO_STATUS_SUCCESS)
    throw IoError(say::file::CannotWrite(file.string(), cairo_status_to_string(status)));
}

}  // namespace

// Millimetres, y down.
struct MarkerSheet::Canvas {
  Canvas(cairo_surface_t* surface, double units_per_mm) : cr(cairo_create(surface)) {
    cairo_scale(cr, units_per_mm, units_per_mm);
    text.emplace(cr);
  }
  ~Canvas() {
    text.reset();
    cairo_destroy(cr);
  }
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  void Grey(double level) const { cairo_set_source_rgb(cr, level, level, level); }
  /// @param right  Where the line must end.
  void Text(double x, double y, double size_mm, const std::string& line, double right) const {
    text->Line(x, y, line, {.size = size_mm}, right - x);
  }
  void Line(double x0, double y0, double x1, double y1, double width) const {
    cairo_set_line_width(cr, width);
    cairo_move_to(cr, x0, y0);
    cairo_line_to(cr, x1, y1);
    cairo_stroke(cr);
  }

  cairo_t* cr;
  std::optional<PrintText> text;
};

MarkerSheet::MarkerSheet(const SheetOptions& options)
    : options_(options), dictionary_(Dictionary(options.dictionary)) {
  if (options.is_board) {
    LayBoard();
    return;
  }
  const Paper* const paper = FindPaper(options.paper);
  if (paper == nullptr) throw InvalidRequest(say::sheet::Paper(options.paper));
  width_mm_ = paper->width_mm;
  height_mm_ = paper->height_mm;
  if (options.ids.empty() || options.ids.size() > kMaxIds)
    throw InvalidRequest(
        say::sheet::NumberOfIds(kMaxIds, static_cast<std::int64_t>(options.ids.size())));
  for (const int id : options.ids) {
    if (id < 0 || id >= dictionary_.size())
      throw InvalidRequest(
          say::sheet::NoSuchMarker(dictionary_.name(), id, dictionary_.size() - 1));
  }
  Lay();
}

void MarkerSheet::Lay() {
  const double side_mm = options_.length_m * 1000.0;
  const double quiet_mm = side_mm / (dictionary_.bits_per_side() + 2);
  const double label_mm = std::max(0.0, kLabel_mm - (1 - kLabelBegin) * quiet_mm);
  const double cell_width = side_mm + 2 * quiet_mm, cell_height = side_mm + 2 * quiet_mm + label_mm;
  const double room_width = width_mm_ - 2 * kMargin_mm,
               room_height = height_mm_ - 2 * kMargin_mm - kFooter_mm;
  if (!(side_mm >= 10.0) || cell_width > room_width || cell_height > room_height) {
    const double largest = std::min(room_width, room_height - kLabel_mm) /
                           (1.0 + 2.0 / (dictionary_.bits_per_side() + 2));
    throw InvalidRequest(
        say::sheet::DoesNotFit(options_.length_m, options_.paper, std::floor(largest) / 1000.0));
  }
  const int columns = static_cast<int>(room_width / cell_width),
            rows = static_cast<int>(room_height / cell_height);
  const double step_x = room_width / columns, step_y = room_height / rows;
  const auto per_page = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  for (std::size_t i = 0; i < options_.ids.size(); ++i) {
    if (i % per_page == 0) pages_.emplace_back();
    const auto place = static_cast<int>(i % per_page);
    const double x = kMargin_mm + step_x * (place % columns) + 0.5 * (step_x - side_mm);
    const double y = kMargin_mm + step_y * (place / columns) + 0.5 * (step_y - label_mm - side_mm);
    pages_.back().push_back({options_.ids[i], x, y});
  }
}

void MarkerSheet::LayBoard() {
  const RoomBoard board = MakeRoomBoard(dictionary_.size(), options_.length_m);
  options_.paper = board.is_a3 ? "A3" : "A4";
  width_mm_ = board.is_a3 ? 297.0 : 210.0;
  height_mm_ = board.is_a3 ? 420.0 : 297.0;
  pages_.emplace_back();
  for (const auto& [id, centre_m] : board.centres_m) {
    const Eigen::Vector2d centre_mm = centre_m / kMillimetre;
    const double half_mm = options_.length_m / kMillimetre / 2;
    pages_.back().push_back(
        {id, width_mm_ / 2 + centre_mm.x() - half_mm, CrossHeight() - centre_mm.y() - half_mm});
  }
}

double MarkerSheet::CrossHeight() const {
  return kMargin_mm + (height_mm_ - 2 * kMargin_mm - kFooter_mm) / 2;
}

/// Lines for the lasers between the markers' white margins, and the direction of the gantry.
void MarkerSheet::DrawCross(const Canvas& canvas) const {
  constexpr double kLine_mm = 0.25;
  const double x = width_mm_ / 2, y = CrossHeight(), bottom = 2 * y - kMargin_mm;
  canvas.Grey(0);
  canvas.Line(x, kMargin_mm, x, bottom, kLine_mm);
  canvas.Line(kMargin_mm, y, width_mm_ - kMargin_mm, y, kLine_mm);
  cairo_move_to(canvas.cr, x, kMargin_mm);
  cairo_line_to(canvas.cr, x + 1.5, kMargin_mm + 3.0);
  cairo_line_to(canvas.cr, x - 1.5, kMargin_mm + 3.0);
  cairo_close_path(canvas.cr);
  cairo_fill(canvas.cr);
  canvas.Text(x + 3.0, kMargin_mm + 2.8, 3.2, Said(say::sheet::ToGantry()), width_mm_ - kMargin_mm);
}

void MarkerSheet::DrawMarker(const Canvas& canvas, const PlacedMarker& marker) const {
  const double side_mm = options_.length_m * 1000.0;
  const int cells = dictionary_.bits_per_side() + 2;
  const double cell_mm = side_mm / cells;
  canvas.Grey(0);
  cairo_rectangle(canvas.cr, marker.left_mm, marker.top_mm, side_mm, side_mm);
  cairo_fill(canvas.cr);
  canvas.Grey(1);
  for (int row = 0; row < cells - 2; ++row) {
    for (int column = 0; column < cells - 2; ++column) {
      if (!dictionary_.Bit(marker.id, row, column)) continue;
      cairo_rectangle(canvas.cr, marker.left_mm + (column + 1) * cell_mm,
                      marker.top_mm + (row + 1) * cell_mm, cell_mm, cell_mm);
    }
  }
  cairo_fill(canvas.cr);  // all cells at once, so that neighbours have no seams

  const double y = marker.top_mm + side_mm + kLabelBegin * cell_mm + 4.5, x = marker.left_mm;
  canvas.Grey(kTextGrey);
  cairo_move_to(canvas.cr, x + 1.5, y - 3.6);
  cairo_line_to(canvas.cr, x + 3.0, y - 1.0);
  cairo_line_to(canvas.cr, x, y - 1.0);
  cairo_close_path(canvas.cr);
  cairo_fill(canvas.cr);
  canvas.Line(x + 1.5, y - 1.0, x + 1.5, y + 0.6, 0.6);
  canvas.Text(x + 4.5, y, 3.6, Said(say::sheet::Marker(marker.id, side_mm)),
              width_mm_ - kMargin_mm);
}

std::string MarkerSheet::Said(const Message& message) const {
  return Text(message, options_.language != nullptr ? *options_.language : EnglishCatalogue());
}

void MarkerSheet::DrawRuler(const Canvas& canvas, int page) const {
  const double x = kMargin_mm, y = height_mm_ - kMargin_mm - 12.0;
  const double right = width_mm_ - kMargin_mm;
  canvas.Grey(0);
  for (int mm = 0; mm <= static_cast<int>(kRuler_mm); ++mm) {
    const double height = mm % 10 == 0 ? 4.0 : mm % 5 == 0 ? 2.8 : 1.6;
    canvas.Line(x + mm, y, x + mm, y - height, 0.12);
  }
  canvas.Line(x, y, x + kRuler_mm, y, 0.12);
  canvas.Text(x + kRuler_mm + 3.0, y, 3.2, Said(say::sheet::Ruler()), right);
  canvas.Grey(kTextGrey);
  const double length_mm = options_.length_m / kMillimetre;
  canvas.Text(x, y + 5.0, 3.0,
              Said(options_.is_board ? say::sheet::BoardFooter(dictionary_.name(), length_mm)
                                     : say::sheet::PageFooter(dictionary_.name(), length_mm,
                                                              page + 1, num_pages())),
              right);
  canvas.Text(x, y + 9.5, 2.2, std::string(kResearchNotice), right);
}

void MarkerSheet::Draw(const Canvas& canvas, int page) const {
  for (const PlacedMarker& marker : markers(page)) DrawMarker(canvas, marker);
  if (options_.is_board) DrawCross(canvas);
  DrawRuler(canvas, page);
}

void MarkerSheet::WritePdf(const std::filesystem::path& file) const {
  const CairoSurface surface(
      cairo_pdf_surface_create(file.c_str(), width_mm_ * kPointsPerMm, height_mm_ * kPointsPerMm));
  DrawPages(surface.get());
  Finish(surface, file);
}

std::string MarkerSheet::Pdf() const {
  std::string bytes;
  const CairoSurface surface(cairo_pdf_surface_create_for_stream(
      &Append, &bytes, width_mm_ * kPointsPerMm, height_mm_ * kPointsPerMm));
  DrawPages(surface.get());
  Finish(surface, say::sheet::File().English());
  return bytes;
}

void MarkerSheet::DrawPages(cairo_surface_t* surface) const {
  for (int page = 0; page < num_pages(); ++page) {
    const Canvas canvas(surface, kPointsPerMm);
    Draw(canvas, page);
    cairo_show_page(canvas.cr);
  }
}

void MarkerSheet::WriteSvg(const std::filesystem::path& file, int page) const {
  const CairoSurface surface(cairo_svg_surface_create(file.c_str(), width_mm_, height_mm_));
  cairo_svg_surface_set_document_unit(surface.get(), CAIRO_SVG_UNIT_MM);
  {
    const Canvas canvas(surface.get(), 1.0);
    Draw(canvas, page);
  }
  Finish(surface, file);
}

cv::Mat MarkerSheet::Rasterise(int page, double dots_per_inch) const {
  const double dots_per_mm = dots_per_inch / 25.4;
  const int width = static_cast<int>(std::lround(width_mm_ * dots_per_mm)),
            height = static_cast<int>(std::lround(height_mm_ * dots_per_mm));
  const CairoSurface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height));
  {
    const Canvas canvas(surface.get(), dots_per_mm);
    canvas.Grey(1);
    cairo_paint(canvas.cr);
    Draw(canvas, page);
  }
  cairo_surface_flush(surface.get());
  if (cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS)
    throw InvalidRequest(say::sheet::TooLarge());
  cv::Mat rgb(height, width, CV_8UC3);
  const unsigned char* data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int y = 0; y < height; ++y) {
    const auto* row =
        reinterpret_cast<const std::uint32_t*>(data + static_cast<std::ptrdiff_t>(y) * stride);
    for (int x = 0; x < width; ++x) {
      const std::uint32_t pixel = row[x];
      rgb.at<cv::Vec3b>(y, x) = {static_cast<std::uint8_t>(pixel >> 16),
                                 static_cast<std::uint8_t>(pixel >> 8),
                                 static_cast<std::uint8_t>(pixel)};
    }
  }
  return rgb;
}

std::vector<int> ParseIds(std::string_view text) {
  std::vector<int> ids;
  const auto fail = [&] { return InvalidRequest(say::sheet::UnreadableIds(text)); };
  const char* at = text.data();
  const char* const end = text.data() + text.size();
  const auto number = [&] {
    int value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || value < 0) throw fail();
    at = next;
    return value;
  };
  for (;;) {
    const int first = number();
    int last = first;
    if (at != end && *at == '-') {
      ++at;
      last = number();
    }
    if (last < first || last - first >= static_cast<int>(kMaxIds) || ids.size() > kMaxIds)
      throw fail();
    for (int id = first; id <= last; ++id) ids.push_back(id);
    if (at == end) return ids;
    if (*at++ != ',') throw fail();
  }
}

}  // namespace plumb
