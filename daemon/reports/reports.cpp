// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/reports.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "algo/base/units.hpp"
#include "daemon/config/version.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/reports/picture_texts.hpp"
#include "daemon/reports/report_pictures.hpp"
#include "daemon/reports/scan_quality.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "web/exchange/local_time.hpp"
#include "web/model/check.hpp"
#include "web/model/course_statistics.hpp"
#include "web/model/limits.hpp"
#include "web/model/numbers.hpp"
#include "web/model/patient.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/wall_clock.hpp"
#include "web/service/result_terms.hpp"
#include "words/result.hpp"

namespace plumb {
namespace {

using web::Word;

constexpr int kMaxScans = 1000;

/// A number in the format of the language.
std::string Said(double value, int digits, const Catalogue& language) {
  std::string text = fmt::format("{:.{}f}", value, digits);
  std::replace(text.begin(), text.end(), '.', language.decimal);
  return text;
}
std::string Said(double value, const Catalogue& language) {
  std::string text = fmt::format("{:g}", value);
  std::replace(text.begin(), text.end(), '.', language.decimal);
  return text;
}

std::string Footer(const Catalogue& language) {
  return Text(say::result::ReportPrinted(Version(), web::LocalTimeText(WallClock::now())),
              language);
}

std::string VerdictOf(const Scan& scan, const Catalogue& language) {
  if (!scan.result) {
    return scan.purpose == ScanPurpose::kReference
               ? Word(say::result::kReportVerdictReference, language)
               : Word(say::result::kReportVerdictNone, language);
  }
  switch (scan.result->verdict) {
    case Verdict::kInTolerance:
      return Word(say::result::kReportVerdictIn, language);
    case Verdict::kUnsure:
      return Word(say::result::kReportVerdictUnsure, language);
    case Verdict::kMove:
      return Word(say::result::kReportVerdictMove, language);
    case Verdict::kNoAnswer:
      break;
  }
  return Word(say::result::kNoAnswer, language);
}

std::string WhyOf(const Scan& scan, const Catalogue& language) {
  if (!scan.result) return Text(scan.failure, language);
  switch (scan.result->verdict) {
    case Verdict::kInTolerance:
      return Word(say::result::kReportWhyIn, language);
    case Verdict::kUnsure:
      return Word(say::result::kReportWhyUnsure, language);
    case Verdict::kMove:
      return Word(say::result::kReportWhyMove, language);
    case Verdict::kNoAnswer:
      break;
  }
  return scan.result->reasons.empty() ? "" : Text(scan.result->reasons.front(), language);
}

ReportFacts FactsOf(const std::vector<web::QualityRow>& rows, const Catalogue& language) {
  ReportFacts facts;
  for (const web::QualityRow& row : rows)
    facts.emplace_back(Text(row.name, language), Text(row.value, language));
  return facts;
}

/// All that is to be read beside the verdict.
std::vector<std::string> CautionsOf(const web::ScanQuality& quality, const Catalogue& language) {
  std::vector<std::string> cautions;
  for (const auto* list : {&quality.cautions, &quality.remarks})
    for (const Message& caution : *list) cautions.push_back(Text(caution, language));
  return cautions;
}

std::string PlanText(const ReferencePlan& plan, const Catalogue& language) {
  constexpr std::array kNames = {say::result::kPostureHfs, say::result::kPostureHfp,
                                 say::result::kPostureFfs, say::result::kPostureFfp};
  const auto name = std::find(kPostures.begin(), kPostures.end(), plan.posture);
  const std::string posture =
      name == kPostures.end()
          ? plan.posture
          : Word(kNames.at(static_cast<std::size_t>(std::distance(kPostures.begin(), name))),
                 language);
  return fmt::format("{}, {}", posture,
                     plan.couch_markers ? Word(say::result::kReportCouchMarkers, language)
                                        : Word(say::result::kReportRoomMarkers, language));
}

std::string ToleranceText(const Tolerance& tolerance, const Catalogue& language) {
  return fmt::format("\u00b1{} mm, \u00b1{}\u00b0", Said(tolerance.shift_mm, language),
                     Said(tolerance.rotation_deg, language));
}

std::string RegionText(const ReferencePlan& plan, const Catalogue& language) {
  const auto& region = plan.region_m;
  if (region.size() < 3) return Word(say::result::kReportWholeBody, language);
  double twice_m2 = 0.0;
  for (std::size_t i = 0; i < region.size(); ++i) {
    const auto &a = region[i], &b = region[(i + 1) % region.size()];
    twice_m2 += a[0] * b[1] - b[0] * a[1];
  }
  return Text(say::result::ReportCorners(static_cast<std::int64_t>(region.size()),
                                         1e4 * std::abs(twice_m2) / 2),
              language);
}

std::string IsocentreText(const ReferencePlan& plan, const Catalogue& language) {
  if (!plan.isocentre_m) return Word(say::result::kReportMiddle, language);
  const auto& [x, y, z] = *plan.isocentre_m;
  return fmt::format("x {}; y {}; z {} m", Said(x, 3, language), Said(y, 3, language),
                     Said(z, 3, language));
}

void AddReferenceTo(ReportFacts& facts, const Reference& reference, const Catalogue& language) {
  facts.emplace_back(
      Word(say::result::kReportReference, language),
      Text(say::result::ReportVersion(reference.version, web::LocalTimeText(reference.created_at)),
           language));
  facts.emplace_back(Word(say::result::kReportPlan, language), PlanText(reference.plan, language));
  facts.emplace_back(Word(say::result::kReportToleranceFact, language),
                     ToleranceText(reference.plan.tolerance, language));
  facts.emplace_back(Word(say::result::kReportRegion, language),
                     RegionText(reference.plan, language));
  facts.emplace_back(Word(say::result::kReportIsocentre, language),
                     IsocentreText(reference.plan, language));
  facts.emplace_back(Word(say::result::kReportPlannedBy, language),
                     reference.planned_by.empty() ? "-" : reference.planned_by);
  facts.emplace_back(Word(say::result::kReportApprovedBy, language),
                     reference.approved_at ? fmt::format("{}, {}", reference.approved_by,
                                                         web::LocalTimeText(*reference.approved_at))
                                           : Word(say::result::kReportNotApproved, language));
  facts.emplace_back(Word(say::result::kReportChecksum, language), reference.digest.substr(0, 16));
}

std::string AcceptedText(const Scan& scan, const Catalogue& language) {
  if (scan.accepted_by.empty()) return {};
  const std::string who = scan.accepted_at ? fmt::format("{}, {}", scan.accepted_by,
                                                         web::LocalTimeText(*scan.accepted_at))
                                           : scan.accepted_by;
  if (scan.accepted_reason.empty()) return Text(say::result::ReportAcceptedBy(who), language);
  return Text(IsUnsure(scan) ? say::result::ReportAcceptedUnsure(who, scan.accepted_reason)
                             : say::result::ReportAcceptedOutside(who, scan.accepted_reason),
              language);
}

ReportFacts IdentityOf(const Scan& scan, const std::optional<Patient>& patient,
                       const std::optional<Reference>& reference, const Catalogue& language) {
  ReportFacts facts;
  const auto add = [&](std::string_view name, std::string value) {
    facts.emplace_back(name, std::move(value));
  };
  add(Word(say::result::kReportPatient, language),
      patient ? patient->code : Word(say::result::kReportUnassigned, language));
  add(Word(say::result::kReportSite, language),
      patient && !patient->site.empty() ? patient->site : "-");
  add(Word(say::result::kReportFraction, language),
      scan.fraction > 0 ? std::to_string(scan.fraction) : "-");
  add(Word(say::result::kReportScan, language),
      fmt::format("{}, {}", scan.id, web::LocalTimeText(scan.started_at)));
  if (!scan.session_by.empty()) add(Word(say::result::kReportSessionBy, language), scan.session_by);
  if (reference) AddReferenceTo(facts, *reference, language);
  const std::string accepted = AcceptedText(scan, language);
  add(Word(say::result::kReportAccepted, language),
      accepted.empty() ? Word(say::result::kReportNo, language) : accepted);
  return facts;
}

/// The reference of the comparison; for a scan of a reference, the reference made from it, with its
/// plan and approver.
std::optional<Reference> ReferenceFor(const ReportSources& stored, const Scan& scan) {
  if (!scan.reference_id.empty() || scan.purpose != ScanPurpose::kReference)
    return stored.references.Find(scan.reference_id);
  const std::vector<Reference> references = stored.references.List(scan.patient_id);
  const auto found = std::find_if(references.begin(), references.end(),
                                  [&](const Reference& one) { return one.scan_id == scan.id; });
  return found == references.end() ? std::nullopt : std::optional(*found);
}

struct ReportPictures {
  std::vector<cv::Mat> pictures;
  std::string note;  ///< To be read below them.
};

ReportPictures PlanPicturesOf(const std::filesystem::path& scan_folder, const ReferencePlan& plan,
                              const RoomFinder& room_in, const Catalogue& language) {
  const PictureTexts pictures(language);
  const SideWords sides = SideWordsIn(language);
  PlanPictures drawn = ReferencePictures(scan_folder, plan, room_in, pictures.words(), sides);
  return {
      .pictures = std::move(drawn.pictures),
      .note = drawn.names_sides ? Word(say::result::kReportPlannedSides, language) : std::string()};
}

ReportPictures PicturesOf(const ReportSources& stored, const Scan& scan,
                          const std::optional<Reference>& reference,
                          const std::optional<StoredResult>& result, const Catalogue& language) {
  if (!reference || scan.folder.empty()) return {};
  if (scan.purpose == ScanPurpose::kReference)
    return PlanPicturesOf(scan.folder, reference->plan, stored.room_in, language);
  const std::optional<Scan> of_reference = stored.scans.Find(reference->scan_id);
  if (!scan.result || !of_reference || of_reference->folder.empty()) return {};
  const PictureTexts pictures(language);
  const SideWords sides = SideWordsIn(language);
  return {.pictures = ComparisonPictures(scan.folder, of_reference->folder, result,
                                         reference->plan.tolerance.shift_mm * kMillimetre,
                                         pictures.words(), sides),
          .note = {}};
}

CourseRow RowOf(const Scan& scan, const Catalogue& language) {
  CourseRow row{.fraction = scan.fraction > 0 ? std::to_string(scan.fraction) : "-",
                .when = web::LocalTimeText(scan.started_at),
                .verdict = VerdictOf(scan, language),
                .accepted = AcceptedText(scan, language),
                .values = {}};
  if (scan.result) {
    for (const ShownRow& number : ShownRows(*scan.result))
      if (number.value)
        row.values[number.number] = CourseValue{*number.value, number.u95, number.judgement};
  }
  return row;
}

/// The newest scans with the same reference, this one included.
std::vector<CourseRow> TrendUntil(const ReportSources& stored, const Scan& scan,
                                  const Catalogue& language) {
  constexpr std::size_t kMost = 40;
  std::vector<CourseRow> rows;
  for (const Scan& one : stored.scans.List(scan.patient_id, kMaxScans)) {
    const bool counts = one.result && one.result->verdict != Verdict::kNoAnswer &&
                        one.reference_id == scan.reference_id && one.started_at <= scan.started_at;
    if (counts && rows.size() < kMost) rows.push_back(RowOf(one, language));
  }
  std::ranges::reverse(rows);
  return rows;
}

/// The six in one line, as "−1.2 ± 0.8 mm"; a single value has no deviation.
std::string SpreadText(const NumberSpreads& spreads, const Catalogue& language) {
  constexpr std::array kNames = {say::result::kShortVertical, say::result::kShortLongitudinal,
                                 say::result::kShortLateral,  say::result::kShortPitch,
                                 say::result::kShortRoll,     say::result::kShortYaw};
  std::string text;
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
    const NumberSpread& spread = spreads[i];
    if (spread.count == 0) continue;
    const int digits = kNumberAxes[i].is_shift() ? 1 : 2;
    text += fmt::format("{}{} {}", text.empty() ? "" : ";  ", Word(kNames.at(i), language),
                        Said(spread.mean, digits, language));
    if (spread.deviation) text += " \u00b1 " + Said(*spread.deviation, digits, language);
  }
  return text;
}

/// Over the fractions, where there are several.
void AddStatistics(ReportFacts& facts, const ReportSources& stored, const std::vector<Scan>& scans,
                   const Catalogue& language) {
  for (const auto& [reference_id, course] : PartsOf(scans)) {
    if (course.fractions < 2) continue;
    const std::optional<Reference> reference = stored.references.Find(reference_id);
    const auto told = [&](const NumberSpreads& spreads) {
      const std::string text = SpreadText(spreads, language);
      return reference ? Text(say::result::ReportSpreadOf(text, reference->version), language)
                       : text;
    };
    facts.emplace_back(Word(say::result::kReportFirstScans, language), told(course.first));
    facts.emplace_back(Word(say::result::kReportLastScans, language), told(course.last));
  }
}

}  // namespace

ScanReport DescribeScan(const ReportSources& stored, const Scan& scan, const Catalogue& language) {
  const std::optional<Patient> patient = stored.patients.Find(scan.patient_id);
  const std::optional<Reference> reference = ReferenceFor(stored, scan);
  const ScanFiles files = FilesOf(scan);
  const web::ScanQuality quality = QualityOf(scan, files, stored.warm_up_min);
  ReportPictures drawn = PicturesOf(stored, scan, reference, files.result, language);
  ScanReport report{
      .language = &language,
      .title = Word(say::result::kReportScanTitle, language),
      .verdict = VerdictOf(scan, language),
      .why = WhyOf(scan, language),
      .identity = IdentityOf(scan, patient, reference, language),
      .numbers = scan.result ? CouchRows(*scan.result, stored.couch) : std::vector<CouchRow>(),
      .cautions = CautionsOf(quality, language),
      .quality = FactsOf(quality.rows, language),
      .body = {},
      .pictures = std::move(drawn.pictures),
      .pictures_note = std::move(drawn.note),
      .footer = Footer(language),
      .paper = stored.paper};
  if (report.numbers.empty()) return report;
  if (RunsAlongCouch(*scan.result))
    for (const Message& note : CouchNotes(stored.couch))
      report.couch.push_back(Text(note, language));
  if (!scan.patient_id.empty()) report.trend = TrendUntil(stored, scan, language);
  for (const Message& part : scan.result->body_after) report.body.push_back(Text(part, language));
  if (report.body.empty()) report.body.emplace_back(Word(say::result::kAsReference, language));
  return report;
}

CourseReport DescribeCourse(const ReportSources& stored, const Patient& patient,
                            const Catalogue& language) {
  CourseReport report{
      .language = &language,
      .title = Text(say::result::ReportCourseTitle(patient.code), language),
      .identity = {{Word(say::result::kReportSite, language),
                    patient.site.empty() ? "-" : patient.site},
                   {Word(say::result::kReportScans, language), std::to_string(patient.num_scans)}},
      .rows = {},
      .note = Word(say::result::kReportDigitsNote, language),
      .footer = Footer(language),
      .paper = stored.paper};
  if (const auto reference = stored.references.Find(patient.approved_reference_id)) {
    AddReferenceTo(report.identity, *reference, language);
    const Tolerance& tolerance = reference->plan.tolerance;
    report.tolerance = {tolerance.shift_mm, tolerance.rotation_deg};
  }
  std::vector<Scan> scans = stored.scans.List(patient.id, kMaxScans);
  AddStatistics(report.identity, stored, scans, language);
  bool is_any_overdue = false, is_any_failed = false;
  for (auto scan = scans.rbegin(); scan != scans.rend(); ++scan) {
    if (scan->outcome != ScanOutcome::kDone) continue;
    CourseRow row = RowOf(*scan, language);
    if (scan->daily_check == DailyCheck::kOverdue) {
      row.verdict += " *";
      is_any_overdue = true;
    } else if (scan->daily_check == DailyCheck::kFailed) {
      row.verdict += " **";
      is_any_failed = true;
    }
    report.rows.push_back(std::move(row));
  }
  if (is_any_overdue)
    report.identity.emplace_back(Word(say::result::kReportOverdueMark, language),
                                 Word(say::result::kReportOverdueWords, language));
  if (is_any_failed)
    report.identity.emplace_back(Word(say::result::kReportFailedMark, language),
                                 Word(say::result::kReportFailedWords, language));
  return report;
}

std::vector<std::string> ComparisonPngs(const ReportSources& stored, const Scan& scan,
                                        const Catalogue& language) {
  std::vector<std::string> files;
  if (!scan.result) return files;
  try {
    const ReportPictures drawn = PicturesOf(stored, scan, stored.references.Find(scan.reference_id),
                                            FilesOf(scan).result, language);
    for (const cv::Mat& picture : drawn.pictures) {
      const std::vector<std::uint8_t> png = EncodePng(picture);
      files.emplace_back(png.begin(), png.end());
    }
  } catch (const std::exception& error) {
    Log(LogLevel::kWarning,
        fmt::format("the pictures of scan {} cannot be drawn: {}", scan.id, error.what()));
    files.clear();
  }
  return files;
}

std::string ScanReportPdf(const ReportSources& stored, const Scan& scan,
                          const Catalogue& language) {
  return PdfOf(DescribeScan(stored, scan, language));
}

std::string CourseReportPdf(const ReportSources& stored, const Patient& patient,
                            const Catalogue& language) {
  return PdfOf(DescribeCourse(stored, patient, language));
}

}  // namespace plumb
