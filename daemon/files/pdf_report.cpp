#include "daemon/files/pdf_report.hpp"

#include <cairo-pdf.h>
#include <cairo.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/notice.hpp"

namespace plumb {
namespace {

constexpr double kWidth = 595.28, kHeight = 841.89;  // A4 in points
constexpr double kMargin = 42.0;
constexpr double kBottom = kHeight - 58.0;
constexpr double kInner = kWidth - 2 * kMargin;

struct Ink {
  double r, g, b;
};
constexpr Ink kBlack{0.08, 0.1, 0.12}, kGrey{0.38, 0.43, 0.48}, kLine{0.75, 0.79, 0.82};
constexpr Ink kGood{0.04, 0.4, 0.24}, kMove{0.58, 0.3, 0.0};

/// Points, y down.
class Pages {
 public:
  explicit Pages(std::string footer) : footer_(std::move(footer)) {
    surface_.reset(cairo_pdf_surface_create_for_stream(&Append, &bytes_, kWidth, kHeight));
    context_.reset(cairo_create(surface_.get()));
    Top();
  }

  double y = 0.0;

  double Width(const std::string& text, double size, bool bold = false) {
    Font(size, bold);
    cairo_text_extents_t extents;
    cairo_text_extents(context_.get(), text.c_str(), &extents);
    return extents.x_advance;
  }
  void Text(double x, double baseline, const std::string& text, double size, Ink ink = kBlack,
            bool bold = false) {
    Font(size, bold);
    cairo_set_source_rgb(context_.get(), ink.r, ink.g, ink.b);
    cairo_move_to(context_.get(), x, baseline);
    cairo_show_text(context_.get(), text.c_str());
  }
  /// Breaks the text into lines of that width; y goes below it.
  void Paragraph(double x, double width, const std::string& text, double size, Ink ink = kBlack,
                 bool bold = false) {
    std::string line;
    std::size_t at = 0;
    while (at < text.size()) {
      const std::size_t end = std::min(text.find(' ', at), text.size());
      const std::string word = text.substr(at, end - at);
      if (!line.empty() && Width(line + " " + word, size, bold) > width) {
        Text(x, y += 1.3 * size, line, size, ink, bold);
        line.clear();
      }
      line += (line.empty() ? "" : " ") + word;
      at = end + 1;
    }
    if (!line.empty()) Text(x, y += 1.3 * size, line, size, ink, bold);
  }
  void Rule(double at, Ink ink = kLine, double line_width = 0.7) {
    cairo_set_source_rgb(context_.get(), ink.r, ink.g, ink.b);
    cairo_set_line_width(context_.get(), line_width);
    cairo_move_to(context_.get(), kMargin, at);
    cairo_line_to(context_.get(), kWidth - kMargin, at);
    cairo_stroke(context_.get());
  }
  /// As large as fits; nothing where the file is missing.
  bool Picture(const std::filesystem::path& file, double x, double top, double width,
               double height) {
    const std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> image(
        cairo_image_surface_create_from_png(file.c_str()), &cairo_surface_destroy);
    if (cairo_surface_status(image.get()) != CAIRO_STATUS_SUCCESS) return false;
    const double w = cairo_image_surface_get_width(image.get());
    const double h = cairo_image_surface_get_height(image.get());
    const double scale = std::min(width / w, height / h);
    cairo_save(context_.get());
    cairo_translate(context_.get(), x + (width - w * scale) / 2, top);
    cairo_scale(context_.get(), scale, scale);
    cairo_set_source_surface(context_.get(), image.get(), 0, 0);
    cairo_paint(context_.get());
    cairo_restore(context_.get());
    return true;
  }
  void Next() {
    Foot();
    cairo_show_page(context_.get());
    Top();
  }
  std::string Finish() {
    Foot();
    cairo_show_page(context_.get());
    cairo_surface_finish(surface_.get());
    if (const cairo_status_t status = cairo_surface_status(surface_.get());
        status != CAIRO_STATUS_SUCCESS)
      throw IoError(fmt::format("cannot draw the report: {}", cairo_status_to_string(status)));
    return std::move(bytes_);
  }

 private:
  static cairo_status_t Append(void* bytes, const unsigned char* data, unsigned int size) {
    static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), size);
    return CAIRO_STATUS_SUCCESS;
  }
  void Font(double size, bool bold) {
    cairo_select_font_face(context_.get(), "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(context_.get(), size);
  }
  void Top() {
    ++page_;
    y = kMargin - 12;
    Paragraph(kMargin, kInner, std::string(kResearchNotice), 7.5, kMove, true);
    Rule(y += 5);
  }
  void Foot() {
    Rule(kHeight - 44);
    Text(kMargin, kHeight - 30, footer_, 7.5, kGrey);
    const std::string number = fmt::format("{}", page_);
    Text(kWidth - kMargin - Width(number, 8), kHeight - 30, number, 8, kGrey);
  }

  std::string bytes_, footer_;
  int page_ = 0;
  std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface_{
      nullptr, &cairo_surface_destroy};
  std::unique_ptr<cairo_t, decltype(&cairo_destroy)> context_{nullptr, &cairo_destroy};
};

/// In two columns of name and text.
void Facts(Pages& pages, const ReportFacts& facts) {
  const double column = kInner / 2, name_width = 92;
  const double top = pages.y;
  double lowest = top;
  const std::size_t half = (facts.size() + 1) / 2;
  for (std::size_t i = 0; i < facts.size(); ++i) {
    const double x = kMargin + (i < half ? 0 : column);
    if (i == half) pages.y = top;
    const double line = pages.y;
    pages.Text(x, line + 1.3 * 8.5, facts[i].first, 8.5, kGrey);
    pages.Paragraph(x + name_width, column - name_width - 8, facts[i].second, 8.5);
    pages.y = std::max(pages.y, line + 1.3 * 8.5);
    lowest = std::max(lowest, pages.y);
  }
  pages.y = lowest + 4;
}

void Heading(Pages& pages, const std::string& text) {
  pages.y += 6;
  pages.Paragraph(kMargin, kInner, text, 11, kBlack, true);
}

/// Digits that the uncertainty lets a value have, as on the page.
int DigitsOf(double u95, int most) {
  if (!(u95 > 0)) return most;
  return std::clamp(static_cast<int>(-std::floor(std::log10(u95) + 1e-9)), 0, most);
}

void NumberLine(Pages& pages, const ReportNumber& number) {
  const double line = pages.y += 15;
  pages.Text(kMargin, line, number.name, 9.5, kBlack, true);
  if (!number.value) {
    pages.Text(kMargin + 90, line, "not known", 9.5, kGrey);
    return;
  }
  const double value = *number.value, size = std::abs(value);
  const int most = number.unit == "mm" ? 1 : 2;
  const int digits = DigitsOf(number.u95, most);
  const bool in = size + number.u95 <= number.tolerance, unsure = !in && size <= number.tolerance;
  pages.Text(
      kMargin + 90, line,
      fmt::format("{:+.{}f} {} \xC2\xB1 {:.{}f}", value, digits, number.unit, number.u95, most),
      9.5, kBlack, true);
  pages.Text(kMargin + 205, line, fmt::format("tolerance \xC2\xB1{:g}", number.tolerance), 8.5,
             kGrey);
  pages.Text(kMargin + 295, line,
             in       ? "in tolerance"
             : unsure ? "not surely within"
                      : "outside tolerance",
             8.5, in ? kGood : kMove, true);
  pages.Text(kMargin + 395, line, number.words, 8.5);
}

}  // namespace

std::string PdfOf(const ScanReport& report) {
  Pages pages(report.footer);
  pages.y += 6;
  pages.Paragraph(kMargin, kInner, report.title, 16, kBlack, true);
  pages.y += 2;
  Facts(pages, report.identity);
  pages.Rule(pages.y += 2);
  pages.Paragraph(kMargin, kInner, report.verdict, 18, kBlack, true);
  if (!report.why.empty()) pages.Paragraph(kMargin, kInner, report.why, 9.5);
  for (const std::string& caution : report.cautions)
    pages.Paragraph(kMargin, kInner, "! " + caution, 9, kMove, true);
  if (!report.numbers.empty()) pages.y += 2;
  for (const ReportNumber& number : report.numbers) NumberLine(pages, number);
  if (!report.body.empty()) {
    Heading(pages, "Posture");
    for (const std::string& words : report.body) pages.Paragraph(kMargin, kInner, words, 8.5);
  }
  if (!report.quality.empty()) {
    Heading(pages, "Scan quality");
    Facts(pages, report.quality);
  }
  const double room = kBottom - pages.y - 6;
  const auto count = static_cast<double>(std::max<std::size_t>(1, report.pictures.size()));
  const double width = (kInner - 10 * (count - 1)) / count;
  double x = kMargin;
  for (const std::filesystem::path& picture : report.pictures) {
    if (room > 60 && pages.Picture(picture, x, pages.y + 6, width, room)) x += width + 10;
  }
  return pages.Finish();
}

std::string PdfOf(const CourseReport& report) {
  constexpr std::array<double, 10> kColumns = {0, 42, 140, 236, 272, 308, 344, 380, 416, 452};
  constexpr std::array<const char*, 10> kHeads = {"Fraction", "When",    "Verdict", "Vert mm",
                                                  "Long mm",  "Lat mm",  "Pitch °", "Roll °",
                                                  "Yaw °",    "Accepted"};
  Pages pages(report.footer);
  pages.y += 6;
  pages.Paragraph(kMargin, kInner, report.title, 16, kBlack, true);
  Facts(pages, report.identity);
  const auto heads = [&] {
    pages.y += 16;
    for (std::size_t i = 0; i < kHeads.size(); ++i)
      pages.Text(kMargin + kColumns[i], pages.y, kHeads[i], 7.5, kGrey, true);
    pages.Rule(pages.y += 4);
  };
  heads();
  for (const CourseRow& row : report.rows) {
    if (pages.y > kBottom - 16) {
      pages.Next();
      heads();
    }
    const double line = pages.y += 13;
    pages.Text(kMargin + kColumns[0], line, row.fraction, 8);
    pages.Text(kMargin + kColumns[1], line, row.when, 8);
    pages.Text(kMargin + kColumns[2], line, row.verdict, 8, kBlack, true);
    for (std::size_t i = 0; i < row.values.size(); ++i) {
      if (row.values[i])
        pages.Text(kMargin + kColumns[3 + i], line,
                   fmt::format("{:+.{}f}", *row.values[i], i < 3 ? 1 : 2), 8);
    }
    pages.Text(kMargin + kColumns[9], line, row.accepted, 7.5);
  }
  return pages.Finish();
}

}  // namespace plumb
