// SPDX-License-Identifier: Apache-2.0
// Reports for printing and filing: one page per scan, and the course of a patient.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/message.hpp"
#include "web/model/couch.hpp"

namespace plumb {

/// Texts are printed unchanged; numbers are formatted by the report.
using ReportFacts = std::vector<std::pair<std::string, std::string>>;

/// A value and its uncertainty, in the units of its column.
struct CourseValue {
  double value = 0.0;
  std::optional<double> u95;  ///< Not set: unknown.
  NumberJudgement judgement = NumberJudgement::kUnjudged;
};

/// A line of the course: one scan.
struct CourseRow {
  std::string fraction, when, verdict, accepted;
  std::array<std::optional<CourseValue>, 6> values;
};

/// A page for one scan.
struct ScanReport {
  const Catalogue* language = &EnglishCatalogue();  ///< Of the fixed texts; never null.
  std::string title, verdict, why;
  ReportFacts identity;  ///< Patient, time with zone, versions, planner, approver and accepter.
  std::vector<CouchRow> numbers;
  std::vector<std::string> couch = {};  ///< How the couch counts them, and what it cannot do.
  std::vector<std::string> cautions;
  ReportFacts quality;
  std::vector<std::string> body;  ///< Differences by part of the body.
  std::vector<CourseRow> trend =
      {};                          ///< Scans with the same reference until this one, oldest first.
  std::vector<cv::Mat> pictures;   ///< CV_8UC3 RGB.
  std::string pictures_note = {};  ///< Below the pictures.
  std::string footer;              ///< Version and time of the report.
  std::string paper = "A4";        ///< Or Letter.
};

struct CourseReport {
  const Catalogue* language = &EnglishCatalogue();  ///< Of the fixed texts; never null.
  std::string title;
  ReportFacts identity;
  std::vector<CourseRow> rows;  ///< Oldest first.
  /// Of the approved reference, mm and degrees; 0: none is approved.
  std::array<double, 2> tolerance = {};
  std::string note;  ///< Below the rows.
  std::string footer;
  std::string paper = "A4";  ///< Or Letter; the rows run across it.
};

/// As the bytes of a PDF file; every page has the notice and its number.
/// @throws IoError if the drawing library fails.
[[nodiscard]] std::string PdfOf(const ScanReport& report);
[[nodiscard]] std::string PdfOf(const CourseReport& report);

}  // namespace plumb
