// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/result_report.hpp"

#include <utility>

#include "algo/base/units.hpp"
#include "daemon/reports/text_report.hpp"
#include "daemon/result/shown_rows.hpp"
#include "words/result.hpp"
#include "words/text_report.hpp"

namespace plumb {
namespace {

struct ResultWords {
  MessageId verdict;
  MessageId why;
};

ResultWords WordsOfVerdict(Verdict verdict) {
  switch (verdict) {
    case Verdict::kInTolerance:
      return {say::result::kReportVerdictIn, say::result::kReportWhyIn};
    case Verdict::kUnsure:
      return {say::result::kReportVerdictUnsure, say::result::kReportWhyUnsure};
    case Verdict::kMove:
    case Verdict::kNoAnswer:
      break;
  }
  return {say::result::kReportVerdictMove, say::result::kReportWhyMove};
}

/// None without an answer, which must not be acted on.
std::vector<CouchRow> RowsOf(const StoredResult& result) {
  std::vector<CouchRow> rows;
  for (const ShownRow& row : ShownRowsOf(result)) rows.push_back(OnCouch(row, result.verdict, {}));
  return rows;
}

ReportFacts QualityFacts(const StoredResult& result, const Catalogue& language) {
  ReportFacts facts;
  const auto add = [&](const Message& name, const Message& value) {
    facts.emplace_back(Text(name, language), Text(value, language));
  };
  if (const auto& alignment = result.alignment) {
    add(say::text_report::Markers(), MarkersThatPlace(*alignment));
  }
  if (const auto& region = result.region)
    add(say::text_report::Region(),
        say::text_report::Covered(100 * region->coverage, region->largest_hole_m / kMillimetre));
  if (const auto& motion = result.motion)
    add(say::text_report::Residual(),
        say::text_report::Residuals(motion->residual_m.median / kMillimetre,
                                    motion->residual_m.p95 / kMillimetre));
  return facts;
}

}  // namespace

ScanReport DescribeResult(const StoredResult& result, const std::string& patient,
                          const std::string& when, std::vector<cv::Mat> pictures,
                          const Catalogue& language) {
  const auto word = [&](MessageId id) { return Text(Message(id, {}), language); };
  const bool has_answer = result.verdict != Verdict::kNoAnswer;
  const ResultWords words = WordsOfVerdict(result.verdict);
  ScanReport report{.language = &language,
                    .title = word(say::result::kReportScanTitle),
                    .verdict = word(has_answer ? words.verdict : say::result::kNoAnswer),
                    .why = has_answer               ? word(words.why)
                           : result.reasons.empty() ? std::string()
                                                    : Text(result.reasons.front(), language),
                    .identity = {{word(say::result::kReportPatient), patient}},
                    .numbers = RowsOf(result),
                    .cautions = {},
                    .quality = QualityFacts(result, language),
                    .body = {},
                    .pictures = std::move(pictures),
                    .footer = Text(say::result::ReportPrinted(result.version, when), language)};
  if (const auto& planned = result.compared_with)
    report.identity.emplace_back(word(say::result::kReportReference),
                                 Text(ComparedWith(*planned), language));
  for (const Message& warning : result.warnings) report.cautions.push_back(Text(warning, language));
  if (!report.numbers.empty() && result.body)
    for (const StoredBodyPart& part : result.body->parts)
      if (!part.words_after.empty()) report.body.push_back(Text(part.words_after, language));
  return report;
}

}  // namespace plumb
