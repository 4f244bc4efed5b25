// Reports for paper and files: one page a scan, and the course of a patient.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace plumb {

/// Texts are shown as they are; numbers are formatted by the report.
using ReportFacts = std::vector<std::pair<std::string, std::string>>;

/// Texts that a report has besides its facts; with {}: patterns of fmt.
struct ReportTexts {
  std::string notice, page = "{}";                  ///< "Page {}".
  std::string posture, quality;                     ///< Headings.
  std::string within, unsure, outside;              ///< Judgements.
  std::string not_known, tolerance = "\u00b1{}{}";  ///< Of value and unit (" mm").
  std::array<std::string, 10> heads;  ///< Of the course's columns: fraction, when, verdict, six
                                      ///< numbers, accepted.
  char decimal = '.';
};

struct ReportNumber {
  std::string name, unit;       ///< "Vertical", "mm".
  std::optional<double> value;  ///< Nothing: not known.
  double u95 = 0.0, tolerance = 0.0;
  std::string words;  ///< Of the direction, or why there is none.
};

/// A page for one scan.
struct ScanReport {
  ReportTexts texts;
  std::string title, verdict, why;
  ReportFacts identity;  ///< Whose, when with zone, versions, who planned, approved and accepted.
  std::vector<ReportNumber> numbers;
  std::vector<std::string> cautions;
  ReportFacts quality;
  std::vector<std::string> body;  ///< Where on the body, in words.
  std::vector<cv::Mat> pictures;  ///< CV_8UC3 RGB.
  std::string footer;             ///< Version and time of the report.
};

/// A value and its uncertainty, in the units of its column.
struct CourseValue {
  double value = 0.0, u95 = 0.0;
};

/// A line of the course: a scan.
struct CourseRow {
  std::string fraction, when, verdict, accepted;
  std::array<std::optional<CourseValue>, 6> values;
};

struct CourseReport {
  ReportTexts texts;
  std::string title;
  ReportFacts identity;
  std::vector<CourseRow> rows;  ///< Oldest first.
  std::string note;             ///< Below the rows.
  std::string footer;
};

/// A value in the digits that its uncertainty lets it have, as on the page: "\u22123 \u00b11.1".
/// @param most  Digits behind the point at most.
[[nodiscard]] std::string ValueWithUncertainty(double value, double u95, int most, char decimal);

/// A4, as the bytes of a PDF file; every page carries the notice and its number.
/// @throws IoError if the drawing library fails.
[[nodiscard]] std::string PdfOf(const ScanReport& report);
[[nodiscard]] std::string PdfOf(const CourseReport& report);

}  // namespace plumb
