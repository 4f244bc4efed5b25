// Reports for printing and filing: one page per scan, and the course of a patient.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace plumb {

/// Texts are printed unchanged; numbers are formatted by the report.
using ReportFacts = std::vector<std::pair<std::string, std::string>>;

/// Fixed texts of a report; with {} they are fmt patterns.
struct ReportTexts {
  std::string notice, page = "{} / {}";             ///< "Page {} of {}".
  std::string posture, quality;                     ///< Headings.
  std::string within, unsure, outside;              ///< Judgements.
  std::string not_known, tolerance = "\u00b1{}{}";  ///< Patterns for value and unit (" mm").
  /// Heads of the course's columns: fraction, when, verdict, six numbers, accepted.
  std::array<std::string, 10> heads;
  char decimal = '.';
};

struct ReportNumber {
  std::string name, unit;       ///< "Vertical", "mm".
  std::optional<double> value;  ///< Not set: unknown.
  double u95 = 0.0, tolerance = 0.0;
  std::string words;  ///< Direction, or why there is none.
};

/// A page for one scan.
struct ScanReport {
  ReportTexts texts;
  std::string title, verdict, why;
  ReportFacts identity;  ///< Patient, time with zone, versions, planner, approver and accepter.
  std::vector<ReportNumber> numbers;
  std::vector<std::string> cautions;
  ReportFacts quality;
  std::vector<std::string> body;   ///< Differences by part of the body.
  std::vector<cv::Mat> pictures;   ///< CV_8UC3 RGB.
  std::string pictures_note = {};  ///< Below the pictures.
  std::string footer;              ///< Version and time of the report.
};

/// A value and its uncertainty, in the units of its column.
struct CourseValue {
  double value = 0.0, u95 = 0.0;
};

/// A line of the course: one scan.
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

/// A4, as the bytes of a PDF file; every page has the notice and its number.
/// @throws IoError if the drawing library fails.
[[nodiscard]] std::string PdfOf(const ScanReport& report);
[[nodiscard]] std::string PdfOf(const CourseReport& report);

}  // namespace plumb
