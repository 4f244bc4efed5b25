#include "daemon/appliance/reports.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/units.hpp"
#include "daemon/appliance/report_pictures.hpp"
#include "daemon/appliance/report_words.hpp"
#include "daemon/appliance/result_directions.hpp"
#include "daemon/config/version.hpp"
#include "daemon/loop/log.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "web/api/local_time.hpp"
#include "web/model/check.hpp"
#include "web/model/limits.hpp"
#include "web/model/numbers.hpp"
#include "web/model/patient.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {
namespace {

using Json = nlohmann::json;
using web::Language;

constexpr double kManyLost = 0.05;
constexpr int kMaxScans = 1000;
constexpr std::size_t kMaxJsonBytes = std::size_t{16} << 20;

/// A pattern of the words with its values.
template <typename... Values>
std::string Filled(std::string_view pattern, const Values&... values) {
  return fmt::format(fmt::runtime(pattern), values...);
}

/// A number in the format of the language.
std::string Said(double value, int digits, const ReportWords& words) {
  std::string text = fmt::format("{:.{}f}", value, digits);
  std::replace(text.begin(), text.end(), '.', words.terms.decimal);
  return text;
}
std::string Said(double value, const ReportWords& words) {
  std::string text = fmt::format("{:g}", value);
  std::replace(text.begin(), text.end(), '.', words.terms.decimal);
  return text;
}

std::string Footer(const ReportWords& words) {
  return Filled(words.printed, Version(), web::LocalTimeText(WallClock::now()));
}

ReportTexts TextsOf(const ReportWords& words) {
  ReportTexts texts;
  texts.notice = words.terms.notice;
  texts.page = words.page;
  texts.posture = words.terms.posture;
  texts.quality = words.quality;
  texts.within = words.terms.within;
  texts.unsure = words.terms.not_surely;
  texts.outside = words.terms.outside;
  texts.not_known = words.terms.not_known;
  texts.tolerance = words.tolerance;
  texts.heads = {std::string(words.fraction), std::string(words.when), std::string(words.verdict)};
  for (std::size_t i = 0; i < words.short_axes.size(); ++i)
    texts.heads[3 + i] = words.short_axes[i];
  texts.heads[9] = words.accepted;
  texts.decimal = words.terms.decimal;
  return texts;
}

/// Nothing if the file is missing or not JSON: the report then leaves out its contents.
Json JsonIn(const std::filesystem::path& file) {
  try {
    return ParseBoundedJsonOrNothing(ReadTextFile(file, kMaxJsonBytes));
  } catch (const std::exception&) {
    return Json::value_t::discarded;
  }
}

std::string_view VerdictOf(const Scan& scan, const ReportWords& words) {
  if (!scan.result) {
    return scan.purpose == ScanPurpose::kReference ? words.verdict_reference : words.verdict_none;
  }
  switch (scan.result->verdict) {
    case Verdict::kInTolerance:
      return words.verdict_in;
    case Verdict::kUnsure:
      return words.verdict_unsure;
    case Verdict::kMove:
      return words.verdict_move;
    case Verdict::kNoAnswer:
      break;
  }
  return words.terms.no_answer;
}

std::string WhyOf(const Scan& scan, Language language) {
  const ReportWords& words = WordsOf(language);
  if (!scan.result) return Translated(scan.failure, language);
  switch (scan.result->verdict) {
    case Verdict::kInTolerance:
      return std::string(words.why_in);
    case Verdict::kUnsure:
      return std::string(words.why_unsure);
    case Verdict::kMove:
      return std::string(words.why_move);
    case Verdict::kNoAnswer:
      break;
  }
  return scan.result->reasons.empty() ? "" : Translated(scan.result->reasons.front(), language);
}

/// A correction without an answer must not be applied, so it is left out.
bool IsAdvice(const Scan& scan) {
  return scan.result && scan.result->correction && scan.result->verdict != Verdict::kNoAnswer;
}

std::vector<ReportNumber> NumbersOf(const Scan& scan, const Json& result,
                                    const Tolerance& tolerance, Language language) {
  std::vector<ReportNumber> numbers;
  if (!IsAdvice(scan)) return numbers;
  const ReportWords& words = WordsOf(language);
  const std::array<std::string, 6> names = AxisNames(result, words.terms);
  const bool moves = scan.result->verdict == Verdict::kMove;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const NumberAxis& axis = kNumberAxes[i];
    const std::optional<double> value = axis.In(scan.result->correction);
    const double half = axis.In(scan.result->u95).value_or(0.0);
    const double limit = axis.is_shift() ? tolerance.shift_mm : tolerance.rotation_deg;
    const bool known = value && std::abs(*value) > half;
    const bool is_within = value && std::abs(*value) + half <= limit;
    numbers.push_back(
        {.name = names[i],
         .unit = axis.symbol(),
         .value = value,
         .u95 = half,
         .tolerance = limit,
         .words = !moves  ? std::string(is_within ? words.terms.no_move : words.terms.scan_again)
                  : known ? Translated(scan.result->words[i], language)
                          : std::string(words.terms.insignificant)});
  }
  return numbers;
}

ReportFacts QualityOf(const Scan& scan, const Json& scene, const Json& result,
                      const ReportWords& words) {
  ReportFacts facts;
  const auto add = [&](std::string_view name, std::string value) {
    facts.emplace_back(name, std::move(value));
  };
  if (result.is_object() && result.contains("alignment") && result["alignment"].is_object()) {
    const Json& alignment = result["alignment"];
    add(words.markers, std::to_string(alignment.value("markers_used", Json::array()).size()));
    add(words.misfit, Said(1000 * alignment.value("rms_m", 0.0), 2, words) + " mm");
  }
  if (result.is_object() && result.contains("region") && result["region"].is_object()) {
    const Json& region = result["region"];
    add(words.covered, Said(100 * region.value("coverage", 0.0), 1, words) + " %");
    add(words.hole, Said(1000 * region.value("largest_hole_m", 0.0), 0, words) + " mm");
  }
  if (result.is_object() && result.contains("room_calibration") &&
      result["room_calibration"].is_object())
    add(words.room_version, std::to_string(result["room_calibration"].value("version", 0)));
  if (scene.is_object() && scene.contains("frames")) {
    const Json& frames = scene["frames"];
    add(words.tracked,
        Filled(words.tracked_of, frames.value("tracked", 0), frames.value("total", 0)));
    add(words.lost, std::to_string(frames.value("dropped", 0)));
    add(words.keyframes, std::to_string(scene.value("keyframes", 0)));
    if (const double gap_s = scene.value("longest_lost_s", 0.0); gap_s > 0)
      add(words.longest_lost, Said(gap_s, 1, words) + " s");
  }
  if (!scan.sensor_serial.empty()) add(words.sensor, scan.sensor_serial);
  if (scan.sensor_on_s) add(words.sensor_on, Said(*scan.sensor_on_s / 60, 0, words) + " min");
  // The program that computed the result, which may be older than the one that prints.
  if (result.is_object() && result.contains("version"))
    add(words.computed_with, "Plumb " + result.value("version", ""));
  return facts;
}

/// Index of a direction's name in result.json among the six; nothing if it is none of them.
std::optional<std::size_t> AxisNamed(const std::string& name) {
  const auto* const found = std::ranges::find(kNumberAxes, name, &NumberAxis::name);
  if (found == kNumberAxes.end()) return std::nullopt;
  return static_cast<std::size_t>(found - kNumberAxes.begin());
}

/// Adds what the comparison could not rely on.
void AddComparisonTo(std::vector<std::string>& cautions, const Json& result, Language language) {
  const ReportWords& words = WordsOf(language);
  const auto part = [&](const char* name) {
    return result.is_object() ? result.value(name, Json()) : Json();
  };
  if (const Json body = part("body"); body.is_object() && !body.value("room_known", true))
    cautions.emplace_back(words.room_unknown);
  if (const Json room = part("room_calibration"); room.is_object() && !room.value("used", true))
    cautions.push_back(
        Filled(words.room_not_used, Translated(room.value("why_not_used", ""), language)));
  if (const Json alignment = part("alignment"); alignment.is_object()) {
    const Json rejected = alignment.value("markers_rejected", Json::object());  // outlives items()
    for (const auto& [id, residual_m] : rejected.items())
      cautions.push_back(
          Filled(words.marker_ignored, id, Said(1000 * residual_m.get<double>(), 0, words)));
  }
  if (const Json motion = part("motion"); motion.is_object()) {
    const std::array<std::string, 6> names = AxisNames(result, words.terms);
    for (const Json& weak : motion.value("weak_directions", Json::array())) {
      const std::string name = weak.value("name", "");
      const std::optional<std::size_t> axis = AxisNamed(name);
      cautions.push_back(Filled(words.weak_direction, axis ? names[*axis] : name));
    }
  }
}

void AddWarningsTo(std::vector<std::string>& cautions, const Json& file, Language language) {
  if (!file.is_object()) return;
  for (const Json& warning : file.value("warnings", Json::array()))
    cautions.push_back(Translated(warning.get<std::string>(), language));
}

/// Cautions beside the verdict, for the report, the page without script and the print view.
std::vector<std::string> CautionsIn(const Scan& scan, const Json& scene, const Json& result,
                                    double warm_up_min, Language language) {
  const ReportWords& words = WordsOf(language);
  std::vector<std::string> cautions;
  if (scene.is_object() && scene.contains("frames")) {
    const double total = scene["frames"].value("total", 0.0);
    const double lost = scene["frames"].value("dropped", 0.0);
    if (total > 0 && lost / total >= kManyLost)
      cautions.push_back(Filled(words.frames_lost, 100 * lost / total));
  }
  if (scan.sensor_on_s && *scan.sensor_on_s < 60 * warm_up_min)
    cautions.emplace_back(words.warming);
  const std::string_view check_caution = web::DailyCheckCaution(scan.daily_check, words.terms);
  if (!check_caution.empty()) cautions.emplace_back(check_caution);
  AddComparisonTo(cautions, result, language);
  AddWarningsTo(cautions, result, language);
  AddWarningsTo(cautions, scene, language);
  return cautions;
}

std::string PlanText(const ReferencePlan& plan, const ReportWords& words) {
  const auto name = std::find(kPostures.begin(), kPostures.end(), plan.posture);
  const std::string posture =
      name == kPostures.end()
          ? plan.posture
          : std::string(
                words.postures[static_cast<std::size_t>(std::distance(kPostures.begin(), name))]);
  return fmt::format("{}, {}", posture,
                     plan.couch_markers ? words.couch_markers : words.room_markers);
}

std::string ToleranceText(const Tolerance& tolerance, const ReportWords& words) {
  return fmt::format("\u00b1{} mm, \u00b1{}\u00b0", Said(tolerance.shift_mm, words),
                     Said(tolerance.rotation_deg, words));
}

std::string RegionText(const ReferencePlan& plan, const ReportWords& words) {
  const auto& region = plan.region_m;
  if (region.size() < 3) return std::string(words.whole_body);
  double twice_m2 = 0.0;
  for (std::size_t i = 0; i < region.size(); ++i) {
    const auto &a = region[i], &b = region[(i + 1) % region.size()];
    twice_m2 += a[0] * b[1] - b[0] * a[1];
  }
  return Filled(words.corners, region.size(), 1e4 * std::abs(twice_m2) / 2);
}

std::string IsocentreText(const ReferencePlan& plan, const ReportWords& words) {
  if (!plan.isocentre_m) return std::string(words.middle);
  const auto& [x, y, z] = *plan.isocentre_m;
  return fmt::format("x {}; y {}; z {} m", Said(x, 3, words), Said(y, 3, words), Said(z, 3, words));
}

void AddReferenceTo(ReportFacts& facts, const Reference& reference, const ReportWords& words) {
  facts.emplace_back(words.reference, Filled(words.version, reference.version,
                                             web::LocalTimeText(reference.created_at)));
  facts.emplace_back(words.plan, PlanText(reference.plan, words));
  facts.emplace_back(words.tolerance_fact, ToleranceText(reference.plan.tolerance, words));
  facts.emplace_back(words.region, RegionText(reference.plan, words));
  facts.emplace_back(words.isocentre, IsocentreText(reference.plan, words));
  facts.emplace_back(words.planned_by, reference.planned_by.empty() ? "-" : reference.planned_by);
  facts.emplace_back(words.approved_by,
                     reference.approved_at ? fmt::format("{}, {}", reference.approved_by,
                                                         web::LocalTimeText(*reference.approved_at))
                                           : std::string(words.not_approved));
  facts.emplace_back(words.checksum, reference.digest.substr(0, 16));
}

std::string AcceptedText(const Scan& scan, const ReportWords& words) {
  if (scan.accepted_by.empty()) return {};
  const std::string who = scan.accepted_at ? fmt::format("{}, {}", scan.accepted_by,
                                                         web::LocalTimeText(*scan.accepted_at))
                                           : scan.accepted_by;
  if (scan.accepted_reason.empty()) return Filled(words.accepted_by, who);
  return Filled(IsUnsure(scan) ? words.accepted_unsure : words.accepted_outside, who,
                scan.accepted_reason);
}

ReportFacts IdentityOf(const Scan& scan, const std::optional<Patient>& patient,
                       const std::optional<Reference>& reference, const ReportWords& words) {
  ReportFacts facts;
  const auto add = [&](std::string_view name, std::string value) {
    facts.emplace_back(name, std::move(value));
  };
  add(words.patient, patient ? patient->code : std::string(words.unassigned));
  add(words.site, patient && !patient->site.empty() ? patient->site : "-");
  add(words.fraction, scan.fraction > 0 ? std::to_string(scan.fraction) : "-");
  add(words.scan, fmt::format("{}, {}", scan.id, web::LocalTimeText(scan.started_at)));
  if (!scan.session_by.empty()) add(words.session_by, scan.session_by);
  if (reference) AddReferenceTo(facts, *reference, words);
  const std::string accepted = AcceptedText(scan, words);
  add(words.accepted, accepted.empty() ? std::string(words.no) : accepted);
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
                              const RoomFinder& room_in, const ReportWords& words) {
  PlanPictures drawn = ReferencePictures(scan_folder, plan, room_in, words.pictures, words.sides);
  return {.pictures = std::move(drawn.pictures),
          .note = std::string(drawn.names_sides ? words.planned_sides : "")};
}

ReportPictures PicturesOf(const ReportSources& stored, const Scan& scan,
                          const std::optional<Reference>& reference, const Json& result,
                          const ReportWords& words) {
  if (!reference || scan.folder.empty()) return {};
  if (scan.purpose == ScanPurpose::kReference)
    return PlanPicturesOf(scan.folder, reference->plan, stored.room_in, words);
  const std::optional<Scan> of_reference = stored.scans.Find(reference->scan_id);
  if (!scan.result || !of_reference || of_reference->folder.empty()) return {};
  return {.pictures = ComparisonPictures(scan.folder, of_reference->folder, result,
                                         reference->plan.tolerance.shift_mm * kMillimetre,
                                         words.pictures, words.sides),
          .note = {}};
}

}  // namespace

ScanReport DescribeScan(const ReportSources& stored, const Scan& scan, Language language) {
  const ReportWords& words = WordsOf(language);
  const std::optional<Patient> patient = stored.patients.Find(scan.patient_id);
  const std::optional<Reference> reference = ReferenceFor(stored, scan);
  const Json scene = JsonIn(scan.folder / "scene/scene.json");
  const Json result = JsonIn(scan.folder / "result/result.json");
  const Tolerance tolerance = reference ? reference->plan.tolerance : Tolerance{};
  ReportPictures drawn = PicturesOf(stored, scan, reference, result, words);
  ScanReport report{.texts = TextsOf(words),
                    .title = std::string(words.scan_title),
                    .verdict = std::string(VerdictOf(scan, words)),
                    .why = WhyOf(scan, language),
                    .identity = IdentityOf(scan, patient, reference, words),
                    .numbers = NumbersOf(scan, result, tolerance, language),
                    .cautions = CautionsIn(scan, scene, result, stored.warm_up_min, language),
                    .quality = QualityOf(scan, scene, result, words),
                    .body = {},
                    .pictures = std::move(drawn.pictures),
                    .pictures_note = std::move(drawn.note),
                    .footer = Footer(words)};
  if (report.numbers.empty()) return report;
  for (const std::string& part : scan.result->body_after)
    report.body.push_back(Translated(part, language));
  if (report.body.empty()) report.body.emplace_back(words.terms.as_reference);
  return report;
}

CourseReport DescribeCourse(const ReportSources& stored, const Patient& patient,
                            Language language) {
  const ReportWords& words = WordsOf(language);
  CourseReport report{
      .texts = TextsOf(words),
      .title = Filled(words.course_title, patient.code),
      .identity = {{std::string(words.site), patient.site.empty() ? "-" : patient.site},
                   {std::string(words.scans), std::to_string(patient.num_scans)}},
      .rows = {},
      .note = std::string(words.digits_note),
      .footer = Footer(words)};
  if (const auto reference = stored.references.Find(patient.approved_reference_id))
    AddReferenceTo(report.identity, *reference, words);
  std::vector<Scan> scans = stored.scans.List(patient.id, kMaxScans);
  bool is_any_overdue = false, is_any_failed = false;
  for (auto scan = scans.rbegin(); scan != scans.rend(); ++scan) {
    if (scan->outcome != ScanOutcome::kDone) continue;
    CourseRow row{.fraction = scan->fraction > 0 ? std::to_string(scan->fraction) : "-",
                  .when = web::LocalTimeText(scan->started_at),
                  .verdict = std::string(VerdictOf(*scan, words)),
                  .accepted = AcceptedText(*scan, words),
                  .values = {}};
    if (scan->daily_check == DailyCheck::kOverdue) {
      row.verdict += " *";
      is_any_overdue = true;
    } else if (scan->daily_check == DailyCheck::kFailed) {
      row.verdict += " **";
      is_any_failed = true;
    }
    if (IsAdvice(*scan)) {
      for (std::size_t i = 0; i < row.values.size(); ++i) {
        const NumberAxis& axis = kNumberAxes[i];
        if (const auto value = axis.In(scan->result->correction))
          row.values[i] = CourseValue{*value, axis.In(scan->result->u95).value_or(0.0)};
      }
    }
    report.rows.push_back(std::move(row));
  }
  if (is_any_overdue)
    report.identity.emplace_back(words.overdue_mark, std::string(words.overdue_words));
  if (is_any_failed)
    report.identity.emplace_back(words.failed_mark, std::string(words.failed_words));
  return report;
}

web::ResultNotes NotesOf(const ReportSources& stored, const Scan& scan, Language language) {
  const auto notes = [&](const Json& scene, const Json& result) {
    return web::ResultNotes{
        .axes = AxisNames(result, WordsOf(language).terms),
        .cautions = CautionsIn(scan, scene, result, stored.warm_up_min, language)};
  };
  try {
    return notes(JsonIn(scan.folder / "scene/scene.json"),
                 JsonIn(scan.folder / "result/result.json"));
  } catch (const Json::exception&) {  // a file that another version wrote differently
    return notes({}, {});
  }
}

std::vector<std::string> ComparisonPngs(const ReportSources& stored, const Scan& scan,
                                        Language language) {
  std::vector<std::string> files;
  if (!scan.result) return files;
  try {
    const ReportPictures drawn =
        PicturesOf(stored, scan, stored.references.Find(scan.reference_id),
                   JsonIn(scan.folder / "result/result.json"), WordsOf(language));
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

std::string ScanReportPdf(const ReportSources& stored, const Scan& scan, Language language) {
  return PdfOf(DescribeScan(stored, scan, language));
}

std::string CourseReportPdf(const ReportSources& stored, const Patient& patient,
                            Language language) {
  return PdfOf(DescribeCourse(stored, patient, language));
}

}  // namespace plumb
