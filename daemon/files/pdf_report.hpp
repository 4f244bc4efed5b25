// Reports for paper and files: one page a scan, and the course of a patient.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace plumb {

/// Texts are shown as they are; numbers are formatted by the report.
using ReportFacts = std::vector<std::pair<std::string, std::string>>;

struct ReportNumber {
  std::string name, unit;       ///< "vertical", "mm".
  std::optional<double> value;  ///< Nothing: not known.
  double u95 = 0.0, tolerance = 0.0;
  std::string words;  ///< Of the direction; empty: no move is needed.
};

/// A page for one scan.
struct ScanReport {
  std::string title, verdict, why;
  ReportFacts identity;  ///< Whose, when with zone, versions, who planned, approved and accepted.
  std::vector<ReportNumber> numbers;
  std::vector<std::string> cautions;
  ReportFacts quality;
  std::vector<std::string> body;                ///< Where on the body, in words.
  std::vector<std::filesystem::path> pictures;  ///< PNG; those that are missing are left out.
  std::string footer;                           ///< Version and time of the report.
};

/// A line of the course: a scan.
struct CourseRow {
  std::string fraction, when, verdict, accepted;
  std::array<std::optional<double>, 6> values;
};

struct CourseReport {
  std::string title;
  ReportFacts identity;
  std::vector<CourseRow> rows;  ///< Oldest first.
  std::string footer;
};

/// A4, as the bytes of a PDF file; every page carries the notice and its number.
/// @throws IoError if the drawing library fails.
[[nodiscard]] std::string PdfOf(const ScanReport& report);
[[nodiscard]] std::string PdfOf(const CourseReport& report);

}  // namespace plumb
