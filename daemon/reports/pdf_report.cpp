// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/pdf_report.hpp"

#include <cairo-pdf.h>
#include <cairo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "algo/base/digits.hpp"
#include "algo/base/errors.hpp"
#include "algo/verdict/number_judgement.hpp"
#include "daemon/sheets/paper.hpp"
#include "daemon/sheets/print_text.hpp"
#include "drivers/files/image_file.hpp"
#include "words/result.hpp"

namespace plumb {
namespace {

/// In points.
struct PageSize {
  double width, height;
};
// Of this layer: the command line has no web.
std::string Word(MessageId id, const Catalogue& language) {
  return Text(Message(id, {}), language);
}

constexpr double kMargin = 42.0, kUnbounded = 10'000.0;

/// A4 where the name is that of no paper.
PageSize Upright(std::string_view name) {
  const Paper* const named = FindPaper(name);
  const Paper& paper = named == nullptr ? kPapers.front() : *named;
  return {paper.width_mm * kPointsPerMm, paper.height_mm * kPointsPerMm};
}

PageSize Across(std::string_view name) {
  const PageSize upright = Upright(name);
  return {upright.height, upright.width};
}

struct Ink {
  double r, g, b;
};
constexpr Ink kBlack{0.08, 0.1, 0.12}, kGrey{0.38, 0.43, 0.48}, kLine{0.75, 0.79, 0.82};
constexpr Ink kShade{0.89, 0.92, 0.94}, kGood{0.04, 0.4, 0.24}, kMove{0.58, 0.3, 0.0};

/// Points, y down.
class Pages {
 public:
  /// @param total  How many pages there will be.
  Pages(const Catalogue& language, std::string footer, const PageSize& paper, int total)
      : language_(language), footer_(std::move(footer)), paper_(paper), total_(total) {
    surface_.reset(
        cairo_pdf_surface_create_for_stream(&Append, &bytes_, paper_.width, paper_.height));
    context_.reset(cairo_create(surface_.get()));
    text_.emplace(context_.get());
    Top();
  }

  double y = 0.0;

  [[nodiscard]] int page() const { return page_; }
  /// Width between the margins, and where the space for contents ends.
  [[nodiscard]] double inner() const { return paper_.width - 2 * kMargin; }
  [[nodiscard]] double bottom() const { return paper_.height - 58.0; }
  double Width(const std::string& text, double size, bool bold = false) const {
    return text_->Width(text, {.size = size, .is_bold = bold});
  }
  /// One line, which ends in an ellipsis before the right margin, or where it is wider than `most`.
  void Text(double x, double baseline, const std::string& text, double size, Ink ink = kBlack,
            bool bold = false, double most = kUnbounded) {
    cairo_set_source_rgb(context_.get(), ink.r, ink.g, ink.b);
    text_->Line(x, baseline, text, {.size = size, .is_bold = bold},
                std::min(most, paper_.width - kMargin - x + 0.5));
  }
  /// Breaks the text into lines of that width and moves y below it.
  void Paragraph(double x, double width, const std::string& text, double size, Ink ink = kBlack,
                 bool bold = false) {
    cairo_set_source_rgb(context_.get(), ink.r, ink.g, ink.b);
    const double step = 1.3 * size;
    y += step * text_->Paragraph(x, y + step, step, width, text, {.size = size, .is_bold = bold});
  }
  void Rule(double at, Ink ink = kLine, double line_width = 0.7) {
    cairo_set_source_rgb(context_.get(), ink.r, ink.g, ink.b);
    cairo_set_line_width(context_.get(), line_width);
    cairo_move_to(context_.get(), kMargin, at);
    cairo_line_to(context_.get(), paper_.width - kMargin, at);
    cairo_stroke(context_.get());
  }
  void Line(double x0, double y0, double x1, double y1, Ink ink, double line_width) {
    cairo_set_source_rgb(context_.get(), ink.r, ink.g, ink.b);
    cairo_set_line_width(context_.get(), line_width);
    cairo_move_to(context_.get(), x0, y0);
    cairo_line_to(context_.get(), x1, y1);
    cairo_stroke(context_.get());
  }
  void Box(double x, double top, double width, double height, Ink ink) {
    cairo_set_source_rgb(context_.get(), ink.r, ink.g, ink.b);
    cairo_rectangle(context_.get(), x, top, width, height);
    cairo_fill(context_.get());
  }
  /// @param filled  Otherwise a ring: a value whose interval is not known.
  void Dot(double x, double at, double radius, Ink ink, bool filled) {
    constexpr double kTurn = 6.283185307179586;
    cairo_set_source_rgb(context_.get(), ink.r, ink.g, ink.b);
    cairo_set_line_width(context_.get(), 0.7);
    cairo_new_path(context_.get());
    cairo_arc(context_.get(), x, at, radius, 0, kTurn);
    filled ? cairo_fill(context_.get()) : cairo_stroke(context_.get());
  }
  /// CV_8UC3 RGB, as large as fits.
  void Picture(const cv::Mat& rgb, double x, double top, double width, double height) {
    const std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> image(
        cairo_image_surface_create(CAIRO_FORMAT_RGB24, rgb.cols, rgb.rows), &cairo_surface_destroy);
    if (cairo_surface_status(image.get()) != CAIRO_STATUS_SUCCESS)
      throw IoError("cannot draw the report: not enough memory for a picture");
    FillSurface(image.get(), rgb);
    AttachJpeg(image.get(), rgb);
    const double scale = std::min(width / rgb.cols, height / rgb.rows);
    const double w = rgb.cols;
    cairo_save(context_.get());
    cairo_translate(context_.get(), x + (width - w * scale) / 2, top);
    cairo_scale(context_.get(), scale, scale);
    cairo_set_source_surface(context_.get(), image.get(), 0, 0);
    cairo_paint(context_.get());
    cairo_restore(context_.get());
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
    for (const cairo_status_t status :
         {cairo_status(context_.get()), cairo_surface_status(surface_.get())}) {
      if (status != CAIRO_STATUS_SUCCESS)
        throw IoError(fmt::format("cannot draw the report: {}", cairo_status_to_string(status)));
    }
    return std::move(bytes_);
  }

 private:
  static void FillSurface(cairo_surface_t* image, const cv::Mat& rgb) {
    cairo_surface_flush(image);
    unsigned char* const data = cairo_image_surface_get_data(image);
    const int stride = cairo_image_surface_get_stride(image);
    for (int row = 0; row < rgb.rows; ++row) {
      const auto* in = rgb.ptr<cv::Vec3b>(row);
      auto* out =
          reinterpret_cast<std::uint32_t*>(data + static_cast<std::ptrdiff_t>(row) * stride);
      for (int column = 0; column < rgb.cols; ++column)
        out[column] = std::uint32_t{in[column][0]} << 16U | std::uint32_t{in[column][1]} << 8U |
                      std::uint32_t{in[column][2]};
    }
    cairo_surface_mark_dirty(image);
  }
  /// What the file contains in place of the pixels: a tenth of their size.
  static void AttachJpeg(cairo_surface_t* image, const cv::Mat& rgb) {
    constexpr int kQuality = 90;
    auto jpeg = std::make_unique<std::vector<std::uint8_t>>(EncodeJpeg(rgb, kQuality));
    const auto remove = [](void* bytes) { delete static_cast<std::vector<std::uint8_t>*>(bytes); };
    if (cairo_surface_set_mime_data(image, CAIRO_MIME_TYPE_JPEG, jpeg->data(), jpeg->size(), remove,
                                    jpeg.get()) == CAIRO_STATUS_SUCCESS)
      (void)jpeg.release();
  }
  static cairo_status_t Append(void* bytes, const unsigned char* data, unsigned int size) {
    static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), size);
    return CAIRO_STATUS_SUCCESS;
  }
  void Top() {
    ++page_;
    y = kMargin - 12;
    Paragraph(kMargin, inner(), Word(say::result::kNotice, language_), 7.5, kMove, true);
    Rule(y += 5);
  }
  void Foot() {
    Rule(paper_.height - 44);
    const std::string number = plumb::Text(say::result::ReportPage(page_, total_), language_);
    const double number_width = Width(number, 8);
    Text(kMargin, paper_.height - 30, footer_, 7.5, kGrey, false, inner() - number_width - 8);
    Text(paper_.width - kMargin - number_width, paper_.height - 30, number, 8, kGrey);
  }

  const Catalogue& language_;
  std::string bytes_, footer_;
  PageSize paper_;
  int page_ = 0, total_;
  std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface_{
      nullptr, &cairo_surface_destroy};
  std::unique_ptr<cairo_t, decltype(&cairo_destroy)> context_{nullptr, &cairo_destroy};
  std::optional<PrintText> text_;
};

/// In two columns, name and text.
void Facts(Pages& pages, const ReportFacts& facts) {
  const double column = pages.inner() / 2, name_width = 92;
  const double top = pages.y;
  double lowest = top;
  const std::size_t half = (facts.size() + 1) / 2;
  for (std::size_t i = 0; i < facts.size(); ++i) {
    const double x = kMargin + (i < half ? 0 : column);
    if (i == half) pages.y = top;
    const double line = pages.y;
    pages.Paragraph(x, name_width - 4, facts[i].first, 8.5, kGrey);
    const double name_end = pages.y;
    pages.y = line;
    pages.Paragraph(x + name_width, column - name_width - 8, facts[i].second, 8.5);
    pages.y = std::max(pages.y, name_end);
    lowest = std::max(lowest, pages.y);
  }
  pages.y = lowest + 4;
}

void Heading(Pages& pages, const std::string& text) {
  pages.y += 6;
  pages.Paragraph(kMargin, pages.inner(), text, 11, kBlack, true);
}

/// Without an uncertainty it is said that there is none.
std::string ValueAndU95(double value, std::optional<double> u95, int most,
                        const Catalogue& language) {
  const ShownNumber shown = Shown(value, u95.value_or(NAN), most, language.decimal);
  const std::string half = shown.u95.empty() ? "?" : shown.u95;
  return shown.value + " \u00b1" + half;
}

/// No measurement is exact: an interval of no width is not known either.
bool IsKnown(const std::optional<double>& u95) { return u95 && *u95 > 0; }

Ink InkOf(NumberJudgement judgement) {
  return judgement == NumberJudgement::kWithin ? kGood : kMove;
}

/// The number with its interval on a line of twice the tolerance, which is shaded.
void ToleranceBar(Pages& pages, double x, double at, double width, const CouchRow& number) {
  if (!(number.tolerance > 0)) return;
  const double middle = x + width / 2, scale = width / (4 * number.tolerance);
  const auto place = [&](double value) { return std::clamp(middle + value * scale, x, x + width); };
  pages.Box(place(-number.tolerance), at - 2.5, width / 2, 5, kShade);
  pages.Line(x, at, x + width, at, kLine, 0.7);
  pages.Line(middle, at - 2.5, middle, at + 2.5, kGrey, 0.7);
  const bool is_known = IsKnown(number.u95);
  if (is_known)
    pages.Line(place(*number.value - *number.u95), at, place(*number.value + *number.u95), at,
               kBlack, 1.6);
  pages.Dot(place(*number.value), at, 2.2, InkOf(number.judged.judgement), is_known);
}

void NumberLine(Pages& pages, const CouchRow& number, const Catalogue& language) {
  const double line = pages.y + 15;
  constexpr double kNameSize = 9.5, kNameWidth = 82;
  pages.y = line - 1.3 * kNameSize;  // the first line of the name is on this line
  pages.Paragraph(kMargin, kNameWidth, Text(number.judged.name, language), kNameSize, kBlack, true);
  const double name_end = pages.y;
  if (!number.value) {
    pages.Text(kMargin + 85, line, Word(say::result::kNotKnown, language), 9.5, kGrey);
    return;
  }
  const std::string unit = UnitBehind(number.axis);
  pages.Text(kMargin + 85, line,
             ValueAndU95(*number.value, number.u95, number.axis.digits, language) + unit, 9.5,
             kBlack, true);
  pages.Text(
      kMargin + 180, line,
      Text(say::result::ReportTolerance(PlainNumber(number.tolerance, language.decimal), unit),
           language),
      8.5, kGrey);
  ToleranceBar(pages, kMargin + 180, line + 6, 76, number);
  constexpr double kWordsAt = 380, kWordsSize = 8;
  constexpr double kJudgementAt = 279, kJudgementSize = 8.5;
  pages.y = line - 1.3 * kJudgementSize;  // the first line of the judgement is on this line
  pages.Paragraph(kMargin + kJudgementAt, kWordsAt - kJudgementAt - 4,
                  Text(JudgementWord(number.judged.judgement), language), kJudgementSize,
                  InkOf(number.judged.judgement), true);
  const double judgement_end = pages.y;
  pages.y = line - 1.3 * kWordsSize;  // the first line of the words is on this line
  pages.Paragraph(kMargin + kWordsAt, pages.inner() - kWordsAt, Text(number.way, language),
                  kWordsSize);
  pages.y = std::max({pages.y, line + 5, name_end, judgement_end});
}

/// One number over the scans.
void TrendOf(Pages& pages, const std::vector<CourseRow>& rows, std::size_t number, double tolerance,
             double x, double top, double width, double height) {
  double most = tolerance;
  for (const CourseRow& row : rows)
    if (const auto& value = row.values.at(number))
      most = std::max(most, std::abs(value->value) + (IsKnown(value->u95) ? *value->u95 : 0.0));
  if (!(most > 0)) most = 1;
  constexpr double kInset = 5, kRoom = 1.1;
  const double middle = top + height / 2, scale = height / 2 / (kRoom * most);
  pages.Box(x, middle - tolerance * scale, width, 2 * tolerance * scale, kShade);
  pages.Line(x, middle, x + width, middle, kLine, 0.7);
  pages.Line(x, top, x, top + height, kLine, 0.7);
  const double step =
      rows.size() > 1 ? (width - 2 * kInset) / static_cast<double>(rows.size() - 1) : 0.0;
  std::optional<std::pair<double, double>> before;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& value = rows[i].values.at(number);
    if (!value) continue;
    const double at = x + kInset + static_cast<double>(i) * step;
    const double y = middle - value->value * scale;
    if (before) pages.Line(before->first, before->second, at, y, kLine, 0.7);
    if (IsKnown(value->u95))
      pages.Line(at, y - *value->u95 * scale, at, y + *value->u95 * scale, kGrey, 0.9);
    pages.Dot(at, y, 1.8, InkOf(value->judgement), IsKnown(value->u95));
    before = {at, y};
  }
}

constexpr double kTrendHeight = 62, kTrendRow = kTrendHeight + 30;

/// The six in one row, so that the map fits on the same page.
void Trends(Pages& pages, const std::vector<CourseRow>& rows, const std::array<double, 2>& limits,
            const Catalogue& language) {
  if (rows.size() < 2) return;
  Heading(pages, Word(say::result::kReportTrend, language));
  constexpr std::array kNames = {say::result::kShortVertical, say::result::kShortLongitudinal,
                                 say::result::kShortLateral,  say::result::kShortPitch,
                                 say::result::kShortRoll,     say::result::kShortYaw};
  constexpr double kGap = 9, kMany = kNames.size();
  const double width = (pages.inner() - (kMany - 1) * kGap) / kMany, row = pages.y;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    const double x = kMargin + static_cast<double>(i) * (width + kGap);
    const double limit = limits.at(i / 3);
    std::string name = Word(kNames.at(i), language);
    if (limit > 0) name += fmt::format("  \u00b1{}", PlainNumber(limit, language.decimal));
    pages.Text(x, row + 12, name, 8, kGrey);
    TrendOf(pages, rows, i, limit, x, row + 16, width, kTrendHeight);
    const double below = row + 16 + kTrendHeight + 8;  // the first and the last fraction
    pages.Text(x, below, rows.front().fraction, 7, kGrey);
    const std::string& last = rows.back().fraction;
    pages.Text(x + width - pages.Width(last, 7), below, last, 7, kGrey);
  }
  pages.y = row + kTrendRow;
}

/// At the foot of the page, to be filled in by hand.
void SignatureLine(Pages& pages, const Catalogue& language) {
  const std::string words = Word(say::result::kReportSignature, language);
  const double line = pages.bottom() - 4;
  pages.Text(kMargin, line, words, 8.5, kGrey);
  const double x = kMargin + pages.Width(words, 8.5) + 8;
  pages.Line(x, line + 2, kMargin + pages.inner(), line + 2, kGrey, 0.7);
}
constexpr double kSignature = 30;  // its height

/// One below the other, each as large as the space for all of them permits.
/// @param foot  Height that is left free at the foot of the page.
void Pictures(Pages& pages, std::span<const cv::Mat> pictures, const std::string& note,
              double foot = 0.0) {
  constexpr double kLeast = 60, kGap = 8, kNoteSize = 8.5;
  const double bottom =
      pages.bottom() - foot - (note.empty() ? 0.0 : 2.6 * kNoteSize);  // two lines
  auto left = static_cast<double>(pictures.size());
  for (const cv::Mat& picture : pictures) {
    const double height = (bottom - pages.y - 6) / left - kGap;
    left -= 1;
    if (height < kLeast) return;
    pages.Picture(picture, kMargin, pages.y + 6, pages.inner(), height);
    pages.y += height + kGap;
  }
  if (!pictures.empty() && !note.empty()) pages.Paragraph(kMargin, pages.inner(), note, kNoteSize);
}

constexpr double kSmall = 6.8;
constexpr std::size_t kCourseColumns = 9;  // fraction, when, verdict, six numbers

bool IsBold(std::size_t column) { return column == 2; }

std::array<std::string, kCourseColumns> CourseHeads(const Catalogue& language) {
  constexpr std::array kHeads = {
      say::result::kReportFraction, say::result::kReportWhen,        say::result::kReportVerdict,
      say::result::kShortVertical,  say::result::kShortLongitudinal, say::result::kShortLateral,
      say::result::kShortPitch,     say::result::kShortRoll,         say::result::kShortYaw};
  std::array<std::string, kCourseColumns> heads;
  std::ranges::transform(kHeads, heads.begin(), [&](MessageId id) { return Word(id, language); });
  return heads;
}

struct CourseTable {
  std::vector<std::array<std::string, kCourseColumns>> cells;  ///< As in the rows of the report.
  std::array<double, kCourseColumns> left{};                   ///< Of the columns, on the page.
  double size = 8.0;                                           ///< Of the texts.
};

/// Columns as wide as their widest text, with equal gaps; smaller texts if they are too wide.
CourseTable TableOf(Pages& pages, const CourseReport& report) {
  constexpr double kLeastGap = 12.0, kMostGap = 30.0, kLeastSize = 4.0;
  CourseTable table;
  const auto heads = CourseHeads(*report.language);
  for (const CourseRow& row : report.rows) {
    auto& cells = table.cells.emplace_back();
    cells[0] = row.fraction, cells[1] = row.when, cells[2] = row.verdict;
    for (std::size_t i = 0; i < row.values.size(); ++i) {
      if (!row.values[i]) continue;
      const CourseValue& shown = *row.values[i];
      cells[3 + i] = ValueAndU95(shown.value, shown.u95, i < 3 ? 1 : 2, *report.language);
    }
  }
  std::array<double, kCourseColumns> widths{};
  const auto measure = [&] {
    double sum = 0;
    for (std::size_t i = 0; i < kCourseColumns; ++i) {
      widths[i] = pages.Width(heads[i], table.size, /*bold=*/true);
      for (const auto& cells : table.cells)
        widths[i] = std::max(widths[i], pages.Width(cells[i], table.size, IsBold(i)));
      sum += widths[i];
    }
    return sum;
  };
  constexpr double kGaps = kCourseColumns - 1;
  double sum = measure();
  for (; sum + kGaps * kLeastGap > pages.inner() && table.size > kLeastSize; sum = measure())
    table.size -= 0.5;
  const double gap = std::min(kMostGap, (pages.inner() - sum) / kGaps);
  double x = kMargin;
  for (std::size_t i = 0; i < kCourseColumns; x += widths[i++] + gap) table.left[i] = x;
  return table;
}

/// Each page states how many there are, which is known only after drawing: a report of several
/// pages is drawn twice.
template <typename Contents>
std::string Numbered(const Catalogue& language, const std::string& footer, const PageSize& paper,
                     const Contents& draw) {
  Pages counted(language, footer, paper, 1);
  draw(counted);
  if (counted.page() == 1) return counted.Finish();
  Pages pages(language, footer, paper, counted.page());
  draw(pages);
  return pages.Finish();
}

void Draw(Pages& pages, const ScanReport& report) {
  pages.y += 6;
  pages.Paragraph(kMargin, pages.inner(), report.title, 16, kBlack, true);
  pages.y += 2;
  Facts(pages, report.identity);
  pages.Rule(pages.y += 2);
  pages.Paragraph(kMargin, pages.inner(), report.verdict, 18, kBlack, true);
  if (!report.why.empty()) pages.Paragraph(kMargin, pages.inner(), report.why, 9.5);
  for (const std::string& caution : report.cautions)
    pages.Paragraph(kMargin, pages.inner(), "! " + caution, 9, kMove, true);
  if (!report.numbers.empty()) pages.y += 2;
  for (const CouchRow& number : report.numbers)
    if (!number.is_hidden) NumberLine(pages, number, *report.language);
  for (const std::string& note : report.couch) pages.Paragraph(kMargin, pages.inner(), note, 8);
  if (!report.body.empty()) {
    Heading(pages, Word(say::result::kPosture, *report.language));
    for (const std::string& words : report.body)
      pages.Paragraph(kMargin, pages.inner(), words, 8.5);
  }
  if (!report.quality.empty()) {
    Heading(pages, Word(say::result::kReportQuality, *report.language));
    Facts(pages, report.quality);
  }
  if (pages.y + kSignature > pages.bottom()) pages.Next();
  SignatureLine(pages, *report.language);
  std::array<double, 2> limits{};
  for (const CouchRow& number : report.numbers)
    limits.at(IsShift(number.judged.number) ? 0 : 1) = number.judged.tolerance;
  const double trends = report.trend.size() < 2 ? 0.0 : kTrendRow + kSignature;
  const bool fits = pages.y + trends + kSignature < pages.bottom();
  if (fits) Trends(pages, report.trend, limits, *report.language);
  if (report.pictures.empty() && (fits || trends == 0.0)) return;
  // The map of a comparison has all that the overlay beside it shows, and may end the page; its
  // scale is to be read.
  constexpr double kReadable = 200.0;
  if (fits && !report.numbers.empty() && pages.bottom() - kSignature - pages.y >= kReadable)
    return Pictures(pages, {report.pictures.data(), 1}, report.pictures_note, kSignature);
  pages.Next();
  if (!fits) Trends(pages, report.trend, limits, *report.language);
  Pictures(pages, report.pictures, report.pictures_note);
}

void Draw(Pages& pages, const CourseReport& report) {
  pages.y += 6;
  pages.Paragraph(kMargin, pages.inner(), report.title, 16, kBlack, true);
  Facts(pages, report.identity);
  const CourseTable table = TableOf(pages, report);
  const auto titles = CourseHeads(*report.language);
  const auto heads = [&] {
    pages.y += 14;
    for (std::size_t i = 0; i < kCourseColumns; ++i)
      pages.Text(table.left[i], pages.y, titles[i], table.size, kGrey, true);
    pages.Rule(pages.y += 4);
  };
  heads();
  for (std::size_t row = 0; row < report.rows.size(); ++row) {
    if (pages.y > pages.bottom() - 44) {
      pages.Next();
      heads();
    }
    const double line = pages.y += 1.8 * table.size;
    for (std::size_t i = 0; i < kCourseColumns; ++i)
      pages.Text(table.left[i], line, table.cells[row][i], table.size, kBlack, IsBold(i));
    // Below, over the full width: who accepted, and why it was outside tolerance.
    if (const std::string& accepted = report.rows[row].accepted; !accepted.empty()) {
      pages.y += 1;
      pages.Paragraph(
          table.left[1], kMargin + pages.inner() - table.left[1],
          fmt::format("{}: {}", Word(say::result::kReportAccepted, *report.language), accepted),
          kSmall, kGrey);
    }
  }
  if (!report.note.empty()) {
    pages.y += 8;
    pages.Paragraph(kMargin, pages.inner(), report.note, kSmall, kGrey);
  }
  if (pages.y + kTrendRow + 2 * kSignature > pages.bottom()) pages.Next();
  Trends(pages, report.rows, report.tolerance, *report.language);
  SignatureLine(pages, *report.language);
}

}  // namespace

std::string PdfOf(const ScanReport& report) {
  return Numbered(*report.language, report.footer, Upright(report.paper),
                  [&](Pages& pages) { Draw(pages, report); });
}

std::string PdfOf(const CourseReport& report) {
  return Numbered(*report.language, report.footer, Across(report.paper),
                  [&](Pages& pages) { Draw(pages, report); });
}

}  // namespace plumb
